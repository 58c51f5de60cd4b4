// unseen bench: measures this machine's Unseen.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <memory>

#include <perception/csf.h>

#include "command.h"
#include "effects_bench.h"
#include "engine_bench.h"
#include "options.h"
#include "output_files.h"
#include "perception_bench.h"
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

Result<int> run(EngineArguments& a) {
    if (const auto ready = check_outputs({a.options.mesh}, {a.json}); !ready) return ready.error();
    auto report = JsonReport::open(a.json);
    if (!report) return report.error();
    const auto result = bench_engine(a.options);
    if (!result) return result.error();
    if (auto ok = report->prepare({{"mesh", result->mesh}, {"rows", to_json(result->rows)}, {"sizes", result->sizes}}); !ok) return ok.error();
    if (auto ok = report->publish(); !ok) return ok.error();
    if (!report->is_on_stdout()) print(result->mesh, result->rows);
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
    add_json_option(*verb, a->json);
    verb->callback([a, sizes] {
        if (sizes->empty() && a->options.quick) a->sizes = quick_sizes;
        a->options.sizes = parse_sizes(a->sizes);
    });
    verb->footer("The machine should be idle. Building the largest trees takes minutes; --keep spares that the next time.\n\n"
                 "Examples:\n  unseen bench engine --quick\n"
                 "  unseen bench engine --mesh dragon.ply --keep /tmp/bench --json engine.json");
    return {verb, [a] { return run(*a); }};
}

struct PerceptionArguments {
    PerceptionBenchOptions options;
    std::string only, json;
};

std::vector<std::string> parse_groups(std::string_view list) {
    std::vector<std::string> groups;
    std::string known;
    for (const char* group : perception_groups) known += (known.empty() ? "" : ", ") + std::string(group);
    while (!list.empty()) {
        const std::size_t comma = list.find(',');
        groups.emplace_back(list.substr(0, comma));
        if (std::find(std::begin(perception_groups), std::end(perception_groups), groups.back()) == std::end(perception_groups))
            refuse("--only takes a list of " + known + ", not '" + groups.back() + "'.");
        list.remove_prefix(comma == std::string_view::npos ? list.size() : comma + 1);
    }
    return groups;
}

std::vector<std::string> achromatic_models() {
    std::vector<std::string> names;
    for (const perception::CsfModel model : perception::csf_models)
        if (perception::is_achromatic(model)) names.emplace_back(perception::name(model));
    return names;
}

Result<int> run(PerceptionArguments& a) {
    std::vector<std::string> inputs = a.options.meshes;
    inputs.insert(inputs.end(), a.options.others.begin(), a.options.others.end());
    if (const auto ready = check_outputs(inputs, {a.json}); !ready) return ready.error();
    auto report = JsonReport::open(a.json);
    if (!report) return report.error();
    const auto result = bench_perception(a.options);
    if (!result) return result.error();
    if (auto ok = report->prepare({{"title", result->title}, {"rows", to_json(result->rows)}, {"views", result->views}}); !ok) return ok.error();
    if (auto ok = report->publish(); !ok) return ok.error();
    if (report->is_on_stdout()) return exit_done;
    print(result->title, result->rows);
    for (const BenchDetails& details : result->details) {
        std::printf("\n%s\n\n", details.title.c_str());
        print_table(details.rows);
    }
    return exit_done;
}

Command perception_command(CLI::App& bench) {
    auto a = std::make_shared<PerceptionArguments>();
    PerceptionBenchOptions& o = a->options;
    CLI::App* verb = bench.add_subcommand("perception", "What fold tests save, whether it can be seen, and what it costs, against what is promised");
    verb->add_option("--mesh", o.meshes, "Meshes or trees (default: the bunny and the dragon, as ./quickstart gets them; without them a sphere with bumps); "
                                             "of the dragon, unless it is named, only random views, from afar, and speed")
        ->type_name("MESH");
    verb->add_option("--other", o.others, "More of them, for the random views and from afar")->type_name("MESH");
    verb->add_option("--only", a->only, "Groups: savings,random,far,hard,tolerance,csf,observers,speed (default: all)")->type_name("LIST");
    verb->add_option("--reference", o.reference, "Published sensitivities, as CSV (default: tests/data in the checkout)")
        ->type_name("FOLDER")
        ->check(CLI::Validator(CLI::ExistingDirectory).description(""));
    verb->add_option("--pictures", o.pictures, "A picture of each group: the worst views, and what the judge saw")->type_name("FOLDER");
    verb->add_option("--second-judge", o.second_judge, "Its model of contrast sensitivity: barten-1999 (default), stela, daly, ...")
        ->type_name("MODEL")
        ->check(one_of(achromatic_models()));
    verb->add_option("--window", o.window_px, "Its side; promises are about 1024 (default)")->type_name("PIXELS")->check(whole(64, 4096));
    verb->add_flag("--quick", o.quick, "Few views: rough figures");
    add_json_option(*verb, a->json);
    verb->callback([a] { a->options.only = parse_groups(a->only); });
    verb->footer("Pictures are drawn with 64 samples a pixel; all of it takes about half an hour without a graphics card.\n\n"
                 "Examples:\n  unseen bench perception --quick\n"
                 "  unseen bench perception --mesh bunny.ply horse.ply armadillo.ply gargoyle.ply --pictures judged --json perception.json\n"
                 "  unseen bench perception --only far,hard");
    return {verb, [a] { return run(*a); }};
}

struct EffectsArguments {
    EffectsBenchOptions options;
    std::string json;
};

Result<int> run(EffectsArguments& a) {
    if (const auto ready = check_outputs(a.options.meshes, {a.json}); !ready) return ready.error();
    auto report = JsonReport::open(a.json);
    if (!report) return report.error();
    const auto result = bench_effects(a.options);
    if (!result) return result.error();
    if (auto ok = report->prepare({{"effects", result->effects}}); !ok) return ok.error();
    if (auto ok = report->publish(); !ok) return ok.error();
    if (report->is_on_stdout()) return exit_done;
    print_table(result->table);
    std::printf("\n");
    for (const std::string& note : result->notes) std::printf("%s\n", note.c_str());
    return exit_done;
}

Command effects_command(CLI::App& bench) {
    auto a = std::make_shared<EffectsArguments>();
    CLI::App* verb = bench.add_subcommand("effects", "What each effect of the perceptual test saves in triangles and costs in time");
    verb->add_option("--mesh", a->options.meshes, "Meshes or trees (default: as for 'unseen bench perception')")->type_name("MESH");
    verb->add_flag("--quick", a->options.quick, "Few repetitions");
    add_json_option(*verb, a->json);
    verb->footer("Examples:\n  unseen bench effects --mesh bunny.ply horse.ply dragon.ply");
    return {verb, [a] { return run(*a); }};
}

} // namespace

Command bench_command(CLI::App& app) {
    CLI::App* verb = app.add_subcommand("bench", "Measure how fast, how small and how invisible Unseen is here");
    verb->require_subcommand(1);
    verb->footer("Examples:\n  unseen bench engine --quick\n  unseen bench perception --quick\n\n"
                 "'unseen bench NAME --help' tells more.");
    const std::vector<Command> commands = {engine_command(*verb), perception_command(*verb), effects_command(*verb)};
    return {verb, [commands] {
                return std::find_if(commands.begin(), commands.end(), [](const Command& c) { return c.parser->parsed(); })->run();
            }};
}

} // namespace unseen::app
