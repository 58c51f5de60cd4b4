// The command `unseen-bench`: measures how fast, how small and how invisible Unseen is on this machine, apart from the
// command that people use.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <memory>

#include <unseen/perception/csf.h>
#include <unseen/session/level_chain.h>
#include <unseen/vdtree/internal/number_text.h>

#include "accuracy_bench.h"
#include "bench_tools.h"
#include "engine_bench.h"
#include "fit_bench.h"
#include "libraries_bench.h"
#include "lod_bench.h"
#include "make_scene.h"
#include "options.h"
#include "output_files.h"
#include "people_bench.h"
#include "perception_bench.h"
#include "points_bench.h"
#include "program.h"
#include "report.h"
#include "scenes_bench.h"
#include "selection_bench.h"
#include "terminal.h"

namespace unseen::app {
namespace {

struct ReportArguments {
    std::string json;
    bool markdown = false;
};

void add_report_options(CLI::App& verb, ReportArguments& report) {
    add_json_option(verb, report.json);
    verb.add_flag("--markdown", report.markdown, "Print the tables as Markdown");
}

// Whole or not at all; nothing where the name is empty.
Result<void> write_text(const std::string& file, const std::string& text) {
    if (file.empty()) return {};
    auto out = vdtree::AtomicFile::create(file);
    if (!out) return out.error();
    if (auto written = out->write(text); !written) return written;
    return out->commit();
}

// A benchmark from its options to its report: what it reads, what it writes, and the load of the machine before.
class BenchRun {
public:
    static Result<BenchRun> open(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs,
                                 const ReportArguments& wanted) {
        std::vector<std::string> all = outputs;
        all.push_back(wanted.json);
        if (const auto ready = check_outputs(inputs, all); !ready) return ready.error();
        auto report = JsonReport::open(wanted.json);
        if (!report) return report.error();
        const MachineLoad load = machine_load();
        if (load.is_high()) print_note(load.advice());
        return BenchRun(std::move(*report), std::move(all), load,
                        wanted.markdown ? TableStyle::markdown : TableStyle::aligned);
    }

    // Writes the report, and the tables for people, where stdout is theirs.
    Result<int> close(Json json, const std::vector<BenchTable>& tables) {
        json["load_average"] = number_or_null(load_.average);
        if (auto ok = report_.prepare(json); !ok) return ok.error();
        if (auto ok = report_.publish(); !ok) return ok.error();
        if (report_.is_on_stdout()) return exit_done;
        for (std::size_t i = 0; i < tables.size(); ++i) {
            if (i > 0) std::printf("\n");
            print(tables[i], style_);
        }
        if (style_ == TableStyle::markdown) return exit_done;
        if (load_.is_high()) std::printf("\nNote: %s\n", load_.advice().c_str());
        std::erase_if(outputs_, [](const std::string& file) { return !std::filesystem::exists(file); });
        print_written(outputs_);
        return exit_done;
    }

private:
    BenchRun(JsonReport report, std::vector<std::string> outputs, MachineLoad load, TableStyle style)
        : report_(std::move(report)), outputs_(std::move(outputs)), load_(load), style_(style) {}

    JsonReport report_;
    std::vector<std::string> outputs_;
    MachineLoad load_;
    TableStyle style_;
};

void add_targets_option(CLI::App& verb, std::string& file) {
    verb.add_option("--targets", file,
                    "What each figure has to reach, in place of what is built in (apps/bench/targets.json)")
        ->type_name("FILE.json");
}

struct EngineArguments {
    EngineBenchOptions options;
    std::string sizes = "70k,0.9M,3.5M,14M,28M", targets;
    ReportArguments report;
};

constexpr const char* quick_sizes = "70k,0.9M";

// "70k" or "3.5M" or "871414".
std::optional<std::uint64_t> parse_size(std::string_view text) {
    double scale = 1;
    if (text.ends_with('k') || text.ends_with('K')) scale = 1e3;
    if (text.ends_with('M')) scale = 1e6;
    if (scale > 1) text.remove_suffix(1);
    const auto value = number_from<double>(text);
    constexpr double least = 100, most = 1e9;
    if (!value || !(*value * scale >= least && *value * scale <= most)) return std::nullopt;
    return static_cast<std::uint64_t>(std::llround(*value * scale));
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
    const auto targets = Targets::read(a.targets);
    if (!targets) return targets.error();
    a.options.targets = *targets;
    auto bench = BenchRun::open({a.options.mesh, a.targets}, {}, a.report);
    if (!bench) return bench.error();
    const auto result = bench_engine(a.options);
    if (!result) return result.error();
    return bench->close({{"mesh", result->mesh}, {"rows", to_json(result->rows)}, {"sizes", result->sizes}},
                        {table_of(result->mesh, result->rows)});
}

Command engine_command(CLI::App& app) {
    auto a = std::make_shared<EngineArguments>();
    CLI::App* verb = app.add_subcommand("engine", "Cuts, budgets, memory and building, against what is promised");
    verb->add_option("--mesh", a->options.mesh,
                     "PLY, OBJ, OFF, STL, glTF or VTK (default: the dragon, as ./quickstart --dragon gets it; "
                     "without it a sphere with bumps)")
        ->type_name("MESH");
    CLI::Option* sizes =
        verb->add_option("--sizes", a->sizes, "Triangles (default: 70k,0.9M,3.5M,14M,28M; with --quick: 70k,0.9M)")
            ->type_name("LIST");
    verb->add_option("--keep", a->options.keep, "Keep meshes and trees there, and take those that are there")
        ->type_name("FOLDER");
    verb->add_flag("--quick", a->options.quick, "Few frames and sizes: rough figures");
    add_targets_option(*verb, a->targets);
    add_report_options(*verb, a->report);
    verb->callback([a, sizes] {
        if (sizes->empty() && a->options.quick) a->sizes = quick_sizes;
        a->options.sizes = parse_sizes(a->sizes);
    });
    verb->footer(
        "The machine should be idle. Building the largest trees takes minutes; --keep spares that the next time.\n\n"
        "Examples:\n  unseen-bench engine --quick\n"
        "  unseen-bench engine --mesh dragon.ply --keep /tmp/bench --json engine.json");
    return {verb, [a] { return run(*a); }};
}

struct PerceptionArguments {
    PerceptionBenchOptions options;
    std::string only, targets, device = "cpu";
    ReportArguments report;
};

std::vector<std::string> parse_groups(std::string_view list) {
    std::vector<std::string> groups;
    std::string known;
    for (const char* group : perception_groups) known += (known.empty() ? "" : ", ") + std::string(group);
    while (!list.empty()) {
        const std::size_t comma = list.find(',');
        groups.emplace_back(list.substr(0, comma));
        if (std::find(std::begin(perception_groups), std::end(perception_groups), groups.back()) ==
            std::end(perception_groups))
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
    const auto targets = Targets::read(a.targets);
    if (!targets) return targets.error();
    a.options.targets = *targets;
    std::vector<std::string> inputs = a.options.meshes;
    inputs.insert(inputs.end(), a.options.others.begin(), a.options.others.end());
    inputs.push_back(a.targets);
    auto bench = BenchRun::open(inputs, {}, a.report);
    if (!bench) return bench.error();
    const auto result = bench_perception(a.options);
    if (!result) return result.error();
    std::vector<BenchTable> tables = {table_of(result->title, result->rows)};
    tables.insert(tables.end(), result->details.begin(), result->details.end());
    return bench->close(
        {{"title", result->title}, {"rows", to_json(result->rows)}, {"views", result->views}, {"device", a.device}},
        tables);
}

Command perception_command(CLI::App& app) {
    auto a = std::make_shared<PerceptionArguments>();
    PerceptionBenchOptions& o = a->options;
    CLI::App* verb = app.add_subcommand(
        "perception", "What fold tests save, whether it can be seen, and what it costs, against what is promised");
    verb->add_option(
            "--mesh", o.meshes,
            "Meshes or trees (default: the bunny and the dragon, as ./quickstart --dragon gets them; without them a "
            "sphere with bumps); "
            "of the dragon, unless it is named, only random views, from afar, and speed")
        ->type_name("MESH");
    verb->add_option("--other", o.others, "More of them, for the random views and from afar")->type_name("MESH");
    verb->add_option("--only", a->only,
                     "Groups: savings,aside,random,far,hard,tolerance,csf,observers,speed (default: all)")
        ->type_name("LIST");
    verb->add_option("--reference", o.reference,
                     "Published sensitivities, as CSV (default: tests/data in the checkout)")
        ->type_name("FOLDER")
        ->check(CLI::Validator(CLI::ExistingDirectory).description(""));
    verb->add_option("--second-judge", o.second_judge,
                     "Its model of contrast sensitivity: barten-fitted (default), stela, daly, ...")
        ->type_name("MODEL")
        ->check(one_of(achromatic_models()));
    verb->add_option("--device", a->device, "Where the judges run: cpu (default) or gpu")
        ->type_name("NAME")
        ->check(one_of({"cpu", "gpu"}));
    verb->add_option("--window", o.window_px, "Its side; promises are about 1024 (default)")
        ->type_name("PIXELS")
        ->check(whole(64, 4096));
    verb->add_option("--views", o.random_views, "Random views (default: 72)")->type_name("N")->check(whole(1, 100000));
    verb->add_option_function<std::uint64_t>(
            "--seed", [&o](const std::uint64_t& seed) { o.seed = seed; },
            "Of the random views, displays and backgrounds (default: drawn anew, and told)")
        ->type_name("N");
    verb->add_flag("--quick", o.quick, "Few views: rough figures");
    add_targets_option(*verb, a->targets);
    add_report_options(*verb, a->report);
    verb->callback([a] {
        a->options.only = parse_groups(a->only);
        a->options.judges_on_gpu = a->device == "gpu";
    });
    verb->footer(
        "Pictures are drawn with 64 samples a pixel; all of it takes about half an hour without a graphics card.\n\n"
        "Examples:\n  unseen-bench perception --quick\n"
        "  unseen-bench perception --mesh bunny.ply horse.ply armadillo.ply gargoyle.ply --json perception.json\n"
        "  unseen-bench perception --only far,hard");
    return {verb, [a] { return run(*a); }};
}

struct PointsArguments {
    PointsBenchOptions options;
    ReportArguments report;
    bool quick = false;
};

Result<int> run(PointsArguments& a) {
    auto bench = BenchRun::open(a.options.models, {}, a.report);
    if (!bench) return bench.error();
    const auto result = bench_points(a.options);
    if (!result) return result.error();
    return bench->close({{"points", result->points}}, result->tables);
}

Command points_command(CLI::App& app) {
    auto a = std::make_shared<PointsArguments>();
    CLI::App* verb = app.add_subcommand("points", "What usual requests keep of models, take, and show");
    verb->add_option("MODEL", a->options.models, "Meshes or trees (default: as for 'unseen-bench perception')")
        ->type_name("TREE.vdt|MESH");
    add_triangles_option(*verb, a->options.budget, "The budget (default: 10000)");
    add_vector(*verb, "--direction", a->options.direction, "From the model towards the eye (default: 0 0 1)");
    add_vector(*verb, "--up", a->options.up, "Up in the picture (default: 0 1 0)");
    verb->add_flag("--quick", a->quick, "Four samples a pixel: rough figures");
    add_report_options(*verb, a->report);
    verb->callback([a] {
        for (const auto& given : {a->options.direction, a->options.up})
            if (given && *given == glm::dvec3(0)) refuse("--direction and --up must not be 0 0 0.");
        if (a->quick) a->options.samples = 4;
    });
    verb->footer("Examples:\n  unseen-bench points bunny.vdt\n"
                 "  unseen-bench points horse.ply --triangles 18000 --direction 1 0 0");
    return {verb, [a] { return run(*a); }};
}

struct LibrariesArguments {
    std::vector<std::string> meshes;
    ReportArguments report;
};

Result<int> run(LibrariesArguments& a) {
    auto bench = BenchRun::open(a.meshes, {}, a.report);
    if (!bench) return bench.error();
    const auto result = bench_libraries(a.meshes);
    if (!result) return result.error();
    return bench->close({{"rows", result->rows}}, {result->table});
}

Command libraries_command(CLI::App& app) {
    auto a = std::make_shared<LibrariesArguments>();
    CLI::App* verb =
        app.add_subcommand("libraries", "OpenMesh's clusterer beside ours, and what CGAL's repair does to meshes");
    verb->add_option("MESH", a->meshes, "Meshes as they come")->required()->type_name("MESH");
    add_report_options(*verb, a->report);
    verb->footer("Examples:\n  unseen-bench libraries teapot.obj bunny.ply");
    return {verb, [a] { return run(*a); }};
}

struct LodBenchArguments {
    std::vector<std::string> models;
    int levels = 5;
    ReportArguments report;
};

Result<int> run(LodBenchArguments& a) {
    auto bench = BenchRun::open(a.models, {}, a.report);
    if (!bench) return bench.error();
    const auto result = bench_lod(a.models, a.levels);
    if (!result) return result.error();
    return bench->close({{"rows", result->rows}}, {result->table});
}

Command lod_bench_command(CLI::App& app) {
    auto a = std::make_shared<LodBenchArguments>();
    CLI::App* verb = app.add_subcommand("lod", "What levels of detail show at their distances, beside meshoptimizer's");
    verb->add_option("MODEL", a->models, "Meshes or trees")->required()->type_name("TREE.vdt|MESH");
    verb->add_option("--levels", a->levels, "At most, with the full mesh (default: 5)")
        ->type_name("N")
        ->check(whole(2, session::most_levels));
    add_report_options(*verb, a->report);
    verb->footer("Examples:\n  unseen-bench lod bunny.ply horse.ply --markdown");
    return {verb, [a] { return run(*a); }};
}

struct FitArguments {
    FitBenchOptions options;
    ReportArguments report;
};

Result<int> run(FitArguments& a) {
    auto bench = BenchRun::open({}, {}, a.report);
    if (!bench) return bench.error();
    const auto result = bench_fit(a.options);
    if (!result) return result.error();
    return bench->close({{"rows", result->rows}}, {result->table});
}

Command fit_command(CLI::App& app) {
    auto a = std::make_shared<FitArguments>();
    CLI::App* verb = app.add_subcommand(
        "fit", "What other values of the fold model's factors keep and show, on meshes that are no evidence");
    verb->add_option("--factor", a->options.factor, "That one alone (default: each, one after the other)")
        ->type_name("NAME")
        ->check(one_of(fit_factors()));
    verb->add_flag("--quick", a->options.quick, "Few views of small meshes: rough figures");
    add_report_options(*verb, a->report);
    verb->footer("Examples:\n  unseen-bench fit --quick --factor contact_reach\n  unseen-bench fit --json fit.json");
    return {verb, [a] { return run(*a); }};
}

struct PeopleArguments {
    std::string table;
    ReportArguments report;
};

Result<int> run(PeopleArguments& a) {
    auto bench = BenchRun::open({}, {}, a.report);
    if (!bench) return bench.error();
    const auto result =
        bench_people(a.table.empty() ? find_in_checkout("data/people/achromatic_thresholds.csv").string() : a.table);
    if (!result) return result.error();
    return bench->close({{"rows", result->rows}}, result->tables);
}

Command people_command(CLI::App& app) {
    auto a = std::make_shared<PeopleArguments>();
    CLI::App* verb = app.add_subcommand(
        "people", "How observers and models of sight compare with people's thresholds, and their fit");
    verb->add_option("--table", a->table, "The thresholds (default: data/people in the checkout)")
        ->type_name("FILE.csv")
        ->check(CLI::Validator(CLI::ExistingFile).description(""));
    add_report_options(*verb, a->report);
    verb->footer("Examples:\n  unseen-bench people\n  unseen-bench people --table mine.csv --json -");
    return {verb, [a] { return run(*a); }};
}

struct ScenesArguments {
    ScenesBenchOptions options;
    ReportArguments report;
    bool quick = false;
};

Result<int> run(ScenesArguments& a) {
    auto bench = BenchRun::open(a.options.scenes, {}, a.report);
    if (!bench) return bench.error();
    const auto result = bench_scenes(a.options);
    if (!result) return result.error();
    return bench->close({{"rows", result->rows}, {"walks", result->walks}}, result->tables);
}

Command scenes_command(CLI::App& app) {
    auto a = std::make_shared<ScenesArguments>();
    CLI::App* verb = app.add_subcommand(
        "scenes", "What masking and occlusion save in scenes, and what discrete levels of detail make of the same");
    verb->add_option("SCENE", a->options.scenes,
                     "Scenes with cameras (default: museum, treasure, house and forest of 'unseen make scene')")
        ->type_name("SCENE.glb");
    verb->add_option("--triangles", a->options.triangles, "Of each of the default scenes, about (default: 500000)")
        ->type_name("N")
        ->check(whole(static_cast<double>(MakeSceneOptions::least_triangles),
                      static_cast<double>(MakeSceneOptions::most_triangles)));
    verb->add_option("--window", a->options.window_px, "Its side (default: 512)")
        ->type_name("PIXELS")
        ->check(whole(64, 4096));
    verb->add_flag_function(
        "--no-shadows", [a](std::int64_t) { a->options.has_shadows = false; }, "No light casts shadows");
    verb->add_flag("--quick", a->quick, "Fewer samples a pixel, and a short walk");
    add_report_options(*verb, a->report);
    verb->callback([a] {
        if (!a->quick) return;
        a->options.samples = 16, a->options.path_frames = 6;
    });
    verb->footer(
        "Examples:\n  unseen-bench scenes --quick\n  unseen-bench scenes mine.glb --window 1024 --json scenes.json");
    return {verb, [a] { return run(*a); }};
}

struct SelectionArguments {
    SelectionBenchOptions options;
    std::vector<std::string> qualities;
    std::vector<int> size;
    ReportArguments report;
    bool quick = false;
};

Result<int> run(SelectionArguments& a) {
    std::vector<std::string> inputs = a.options.scenes;
    inputs.insert(inputs.end(), a.options.selections.begin(), a.options.selections.end());
    inputs.insert(inputs.end(), a.options.statues.begin(), a.options.statues.end());
    auto bench = BenchRun::open(inputs, {}, a.report);
    if (!bench) return bench.error();
    auto result = bench_selection(a.options);
    if (!result) return result.error();
    result->json["budget"] = a.options.budget;
    result->json["width"] = a.options.width;
    result->json["height"] = a.options.height;
    result->json["samples"] = a.options.samples;
    return bench->close(std::move(result->json), result->tables);
}

Command selection_command(CLI::App& app) {
    auto a = std::make_shared<SelectionArguments>();
    SelectionBenchOptions& o = a->options;
    CLI::App* verb = app.add_subcommand(
        "selection", "What a flight shows of levels selected beforehand, of switching by area and distance, and of the "
                     "tree's budget");
    verb->add_option("SCENE", o.scenes, "Scenes (default: spheres, bunnies and models of 'unseen make scene')")
        ->type_name("SCENE.glb");
    CLI::Option* selections =
        verb->add_option("--selection", o.selections, "Of each scene, in their order (default: made here)")
            ->type_name("FILE.sel")
            ->allow_extra_args(false);
    verb->add_option("--quality", a->qualities,
                     "What selected levels lose least of: ssim (default), pixels or contrast; may be given again, and "
                     "each is flown")
        ->type_name("NAME")
        ->allow_extra_args(false)
        ->check(one_of({"ssim", "pixels", "contrast"}))
        ->excludes(selections);
    verb->add_option("--spacing", o.spacing,
                     "Of the search's corners, world units (default: a tenth of the scene's longer side)")
        ->type_name("X")
        ->check(positive())
        ->excludes(selections);
    verb->add_option("--window", o.window_px, "Of the search's cameras, a side (default: 256)")
        ->type_name("PIXELS")
        ->check(whole(11, 8192))
        ->excludes(selections);
    verb->add_option("--mesh", o.statues, "A statue of the default scenes; may be given again")
        ->type_name("FILE")
        ->allow_extra_args(false);
    verb->add_option("--scene-triangles", o.scene_triangles,
                     "Of each of the default scenes (default: 1.1 to 2.8 million)")
        ->type_name("N")
        ->check(whole(static_cast<double>(MakeSceneOptions::least_triangles),
                      static_cast<double>(MakeSceneOptions::most_triangles)));
    verb->add_option("--triangles", o.budget, "The budget (default: 300000)")->type_name("N")->check(whole(1, 1e9));
    verb->add_option("--frames", o.frames, "Of the flight (default: 1000)")->type_name("N")->check(whole(2, 100000));
    verb->add_option("--every", o.judged_every, "Frames of which one is drawn and judged (default: 10)")
        ->type_name("N")
        ->check(whole(1, 100000));
    verb->add_option("--size", a->size, "Of the frames (default: 640 360; the thesis has 1920 1080)")
        ->type_name("W H")
        ->expected(2)
        ->check(whole(16, 8192));
    verb->add_option("--samples", o.samples, "A pixel (default: 4)")->type_name("N")->check(whole(1, 256));
    verb->add_flag("--masked-tree", o.has_masked_tree, "The tree's budget with masking, too: seconds a frame");
    verb->add_flag("--quick", a->quick, "Few frames, one sample a pixel");
    add_report_options(*verb, a->report);
    verb->callback([a] {
        if (a->quick) a->options.judged_every = 100, a->options.samples = 1;
        if (!a->qualities.empty()) {
            using session::SelectionQuality;
            a->options.qualities.clear();
            for (const auto quality : {SelectionQuality::ssim, SelectionQuality::pixels, SelectionQuality::contrast})
                if (std::ranges::find(a->qualities, name_of(quality)) != a->qualities.end())
                    a->options.qualities.push_back(quality);
        }
        if (!a->size.empty()) a->options.width = a->size[0], a->options.height = a->size[1];
    });
    verb->footer(
        "Examples:\n  unseen-bench selection --quick\n"
        "  unseen-bench selection --mesh bunny.ply --mesh dragon.ply --mesh armadillo.ply\n"
        "  unseen-bench selection --quality ssim --quality pixels\n"
        "  unseen-bench selection mine.glb --selection mine.sel --every 1 --size 1920 1080 --json flight.json");
    return {verb, [a] { return run(*a); }};
}

struct AccuracyArguments {
    AccuracyBenchOptions options;
    std::string csv, html, plots;
    ReportArguments report;
    bool quick = false, brief = false;
};

Result<int> run(AccuracyArguments& a) {
    std::vector<std::string> outputs = {a.csv, a.html};
    if (!a.plots.empty())
        for (const std::string& key : a.options.only.empty() ? accuracy_axis_keys() : a.options.only)
            outputs.push_back((std::filesystem::path(a.plots) / accuracy_picture_name(key)).string());
    auto bench = BenchRun::open(a.options.models, outputs, a.report);
    if (!bench) return bench.error();
    const auto result = bench_accuracy(a.options);
    if (!result) return result.error();
    if (auto ok = write_text(a.csv, to_csv(*result)); !ok) return ok.error();
    if (auto ok = write_text(a.html, to_html(*result)); !ok) return ok.error();
    if (!a.plots.empty())
        if (auto ok = write_pictures(*result, a.plots); !ok) return ok.error();
    const auto& tables = result->tables;
    return bench->close(result->json, a.brief ? std::vector(tables.begin(), tables.begin() + 1) : tables);
}

Command accuracy_command(CLI::App& app) {
    auto a = std::make_shared<AccuracyArguments>();
    CLI::App* verb = app.add_subcommand("accuracy", "What accuracy costs: error against cost for each choice");
    verb->add_option(
            "MODEL", a->options.models,
            "Meshes, trees and scenes (default: the meshes that are installed, and the scenes of 'unseen scene "
            "make')")
        ->type_name("MODEL");
    verb->add_flag("--scenes", a->options.has_scenes, "Besides MODEL, the scenes of 'unseen make scene'");
    verb->add_option("--csv", a->csv, "One line a point")->type_name("FILE.csv");
    verb->add_option("--html", a->html, "A page with plots, for browsers; it needs no other file")
        ->type_name("FILE.html");
    verb->add_option("--plots", a->plots, "A folder for a plot of each axis, accuracy_AXIS.png")->type_name("FOLDER");
    std::string keys;
    for (const std::string& key : accuracy_axis_keys()) keys += (keys.empty() ? "" : ", ") + key;
    verb->add_option("--only", a->options.only, "These axes alone, of " + keys + "; may be given again (default: all)")
        ->type_name("AXIS")
        ->check(one_of(accuracy_axis_keys()));
    verb->add_option("--seconds", a->options.seconds, "For the ways to fold of each model, at most (default: 300)")
        ->type_name("T")
        ->check(positive());
    verb->add_option("--window", a->options.window_px, "Its side (default: 512)")
        ->type_name("PIXELS")
        ->check(whole(64, 4096));
    verb->add_flag("--brief", a->brief, "Print the first table alone: what the defaults buy and cost");
    verb->add_flag("--quick", a->quick, "Fewer nodes of each tree, which takes less time");
    add_report_options(*verb, a->report);
    verb->callback([a] {
        if (!a->quick) return;
        a->options.nodes = 500;
    });
    verb->footer("Examples:\n  unseen-bench accuracy --quick\n"
                 "  unseen-bench accuracy mine.glb part.stl --html accuracy.html --csv accuracy.csv\n"
                 "  unseen-bench accuracy bunny.ply --only spheres --only facing --plots plots");
    return {verb, [a] { return run(*a); }};
}

constexpr const char* about =
    "unseen-bench measures how fast, how small and how invisible Unseen is on this machine, against what is promised.";
constexpr const char* examples = R"(Examples:
  unseen-bench engine --quick
  unseen-bench perception --quick

'unseen-bench VERB --help' tells more. Exit status: 0 done, 1 failed, 2 wrong usage.)";

} // namespace
} // namespace unseen::app

int main(int argc, char** argv) {
    using namespace unseen::app;
    return run_program(argc, argv, {"unseen-bench", about, examples, UNSEEN_VERSION, {}}, [](CLI::App& app) {
        return std::vector<Command>{engine_command(app),    perception_command(app), points_command(app),
                                    lod_bench_command(app), fit_command(app),        people_command(app),
                                    scenes_command(app),    selection_command(app),  accuracy_command(app),
                                    libraries_command(app)};
    });
}
