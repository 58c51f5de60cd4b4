// unseen bench: measures this machine's Unseen.
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <memory>

#include "command.h"
#include "engine_bench.h"
#include "options.h"
#include "report.h"
#include "terminal.h"

namespace unseen::app {
namespace {

struct EngineArguments {
    EngineBenchOptions options;
    std::string sizes = "70k,0.9M,3.5M,14M,28M", json;
};

constexpr const char* quick_sizes = "70k,0.9M";

// "70k" or "3.5M" or "871414".
std::optional<std::uint64_t> parse_size(std::string_view text) {
    double scale = 1;
    if (text.ends_with('k') || text.ends_with('K')) scale = 1e3;
    if (text.ends_with('M')) scale = 1e6;
    if (scale > 1) text.remove_suffix(1);
    double value = 0;
    const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (code != std::errc() || end != text.data() + text.size()) return std::nullopt;
    constexpr double least = 100, most = 1e9;
    if (!(value * scale >= least && value * scale <= most)) return std::nullopt;
    return static_cast<std::uint64_t>(std::llround(value * scale));
}

std::vector<std::uint64_t> parse_sizes(std::string_view list) {
    std::vector<std::uint64_t> sizes;
    while (true) {
        const std::size_t comma = list.find(',');
        const auto size = parse_size(list.substr(0, comma));
        if (!size || (!sizes.empty() && *size <= sizes.back()))
            refuse("--sizes must be ascending counts of triangles from 100 to 1000M, such as 70k,0.9M,14M.");
        sizes.push_back(*size);
        if (comma == std::string_view::npos) return sizes;
        list.remove_prefix(comma + 1);
    }
}

bool holds(const BenchRow& row, double bound) {
    return row.more_is_better ? *row.value >= bound : *row.value <= bound;
}

std::string fixed(double value, int decimals) {
    std::array<char, 64> text;
    std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
    return text.data();
}

std::string bound_text(const std::optional<double>& bound) {
    return bound ? rounded(*bound, 4) : "";
}

std::string verdict(const BenchRow& row) {
    if (!row.value || !row.must) return "";
    if (row.aim && holds(row, *row.aim)) return "aim";
    return holds(row, *row.must) ? "must" : "NO";
}

void print(const BenchResult& result) {
    std::printf("%s\n\n", result.mesh.c_str());
    std::vector<std::vector<std::string>> rows = {{"measure", "measured", "unit", "must", "aim", "holds"}};
    for (const BenchRow& row : result.rows)
        rows.push_back({row.name, row.value ? fixed(*row.value, row.decimals) : "not available", row.unit,
                        bound_text(row.must), bound_text(row.aim), verdict(row)});
    print_table(rows);
    std::printf("\n");
    for (const BenchRow& row : result.rows)
        if (!row.note.empty()) std::printf("%s: %s\n", row.name.c_str(), row.note.c_str());
}

Json to_json(const BenchResult& result) {
    Json rows = Json::array();
    const auto bound = [](const std::optional<double>& value) { return value ? number_or_null(*value) : Json(nullptr); };
    const auto held = [](const BenchRow& row, const std::optional<double>& value) {
        return row.value && value ? Json(holds(row, *value)) : Json(nullptr);
    };
    for (const BenchRow& row : result.rows)
        rows.push_back({{"name", row.name},
                        {"value", bound(row.value)},
                        {"unit", row.unit},
                        {"must", bound(row.must)},
                        {"aim", bound(row.aim)},
                        {"holds_must", held(row, row.must)},
                        {"holds_aim", held(row, row.aim)},
                        {"note", row.note}});
    return {{"mesh", result.mesh}, {"rows", rows}, {"sizes", result.sizes}};
}

Result<int> run(EngineArguments& a) {
    auto report = JsonReport::open(a.json);
    if (!report) return report.error();
    const auto result = bench_engine(a.options);
    if (!result) return result.error();
    if (auto ok = report->prepare(to_json(*result)); !ok) return ok.error();
    if (auto ok = report->publish(); !ok) return ok.error();
    if (!report->is_on_stdout()) print(*result);
    return exit_done;
}

Command engine_command(CLI::App& bench) {
    auto a = std::make_shared<EngineArguments>();
    CLI::App* verb = bench.add_subcommand("engine", "Cuts, budgets, memory and building, against what is promised");
    verb->add_option("--mesh", a->options.mesh, "PLY, OBJ, OFF, STL or glTF (default: the dragon, as ./quickstart gets it; "
                                                "without it a sphere with bumps)")
        ->type_name("MESH");
    CLI::Option* sizes = verb->add_option("--sizes", a->sizes, "Triangles (default: 70k,0.9M,3.5M,14M,28M; with --quick: 70k,0.9M)")
                             ->type_name("LIST");
    verb->add_option("--keep", a->options.keep, "Keep meshes and trees there, and take those that are there")->type_name("FOLDER");
    verb->add_flag("--quick", a->options.quick, "Few frames and sizes: rough figures");
    verb->add_option("--json", a->json, "Report as JSON, to a file or to stdout (-)")->type_name("FILE|-");
    verb->callback([a, sizes] {
        if (sizes->empty() && a->options.quick) a->sizes = quick_sizes;
        a->options.sizes = parse_sizes(a->sizes);
    });
    verb->footer("The machine should be idle. Building the largest trees takes minutes; --keep spares that the next time.\n\n"
                 "Examples:\n  unseen bench engine --quick\n"
                 "  unseen bench engine --mesh dragon.ply --keep /tmp/bench --json engine.json");
    return {verb, [a] { return run(*a); }};
}

} // namespace

Command bench_command(CLI::App& app) {
    CLI::App* verb = app.add_subcommand("bench", "Measure how fast and how small Unseen is here");
    verb->require_subcommand(1);
    verb->footer("Examples:\n  unseen bench engine --quick\n\n'unseen bench engine --help' tells more.");
    return {verb, engine_command(*verb).run};
}

} // namespace unseen::app
