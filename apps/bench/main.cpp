// The command `unseen-bench`: measures how fast, how small and how invisible Unseen is on this machine, apart from the
// command that people use.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>

#include <unseen/vdtree/internal/number_text.h>

#include "bench_tools.h"
#include "benches.h"
#include "make_scene.h"
#include "options.h"
#include "output_files.h"
#include "program.h"
#include "terminal.h"

namespace unseen::app {
namespace {

struct Reporting {
    std::string json;
    bool markdown = false;
};

// A benchmark from its options to its report, and the load of the machine before.
Result<int> run(const BenchOptions& options, const Reporting& reporting, const FunctionRef<BenchReport()>& measure) {
    try {
        std::vector<std::string> outputs = options.outputs;
        outputs.push_back(reporting.json);
        require(check_outputs(options.inputs, outputs));
        JsonReport json = require(JsonReport::open(reporting.json));
        const MachineLoad load = MachineLoad::now();
        if (const std::string advice = load.advice(); !advice.empty()) print_note(advice);
        BenchReport report = measure();
        for (const BenchTable& table : report.tables) table.add_to(report.json["rows"]);
        if (report.json["rows"].is_null()) report.json.erase("rows");
        report.json["load_average"] = number_or_null(load.average);
        require(json.prepare(report.json));
        require(json.publish());
        if (json.is_on_stdout()) return exit_done;
        for (std::size_t i = 0; i < report.tables.size(); ++i) {
            if (i > 0) std::printf("\n");
            print(report.tables[i], reporting.markdown ? TableStyle::markdown : TableStyle::aligned);
        }
        if (reporting.markdown) return exit_done;
        if (const std::string advice = load.advice(); !advice.empty()) std::printf("\nNote: %s\n", advice.c_str());
        std::erase_if(outputs, [](const std::string& file) { return !std::filesystem::exists(file); });
        print_written(outputs);
        return exit_done;
    } catch (const BenchFailure& failure) {
        return failure.error;
    }
}

template <class Options>
Command bench_verb(CLI::App& app, const char* name, const char* about, const char* examples,
                   BenchReport (*measure)(const Options&),
                   const std::function<void(CLI::App&, std::type_identity_t<Options>&)>& add_options) {
    struct Arguments {
        Options options;
        Reporting reporting;
    };
    const auto a = std::make_shared<Arguments>();
    CLI::App* const parser = app.add_subcommand(name, about);
    add_options(*parser, a->options);
    add_json_option(*parser, a->reporting.json);
    parser->add_flag("--markdown", a->reporting.markdown, "Print the tables as Markdown");
    parser->footer(examples);
    return {parser, [a, measure] { return run(a->options, a->reporting, [&] { return measure(a->options); }); }};
}

void add_window_option(CLI::App& verb, int& window_px, const std::string& text) {
    add_value(verb, "--window", window_px, whole(64, 4096), "PIXELS", text);
}

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

void add_engine_options(CLI::App& verb, EngineOptions& o) {
    verb.add_option(
            "--mesh", o.inputs,
            "PLY, OBJ, OFF, STL, glTF or VTK (default: the dragon, as ./quickstart --dragon gets it; without it "
            "a sphere with bumps)")
        ->type_name("MESH")
        ->expected(1);
    const auto sizes = std::make_shared<std::vector<std::string>>();
    verb.add_option("--sizes", *sizes, "Triangles (default: 70k,0.9M,3.5M,14M,28M; with --quick: 70k,0.9M)")
        ->type_name("LIST")
        ->delimiter(',')
        ->allow_extra_args(false);
    verb.add_option("--keep", o.keep, "Keep meshes and trees there, and take those that are there")
        ->type_name("FOLDER");
    verb.add_flag("--quick", o.quick, "Few frames and sizes: rough figures");
    verb.callback([sizes, &o] {
        if (sizes->empty()) {
            *sizes = {"70k", "0.9M"};
            if (!o.quick) sizes->insert(sizes->end(), {"3.5M", "14M", "28M"});
        }
        for (const std::string& text : *sizes) {
            const auto size = parse_size(text);
            if (!size || (!o.sizes.empty() && *size <= o.sizes.back()))
                refuse("--sizes must be ascending counts of triangles from 100 to 1000M, such as 70k,0.9M,14M.");
            o.sizes.push_back(*size);
        }
    });
}

void add_perception_options(CLI::App& verb, PerceptionOptions& o) {
    verb.add_option("--mesh", o.meshes,
                    "Meshes or trees (default: the bunny and the dragon, as ./quickstart --dragon gets them; without "
                    "them a sphere with bumps); of the dragon, unless it is named, only random views and from afar")
        ->type_name("MESH");
    verb.add_option("--other", o.others, "More of them, for the random views and from afar")->type_name("MESH");
    const std::vector<std::string> groups(perception_groups.begin(), perception_groups.end());
    add_value(verb, "--only", o.only, one_of(groups), "LIST",
              "Groups: " + listed(groups) + " (default: all but foliage: name its meshes)")
        ->delimiter(',')
        ->allow_extra_args(false);
    add_window_option(verb, o.window_px, "Its side; promises are about 1024 (default)");
    add_value(verb, "--views", o.random_views, whole(1, 100000), "N", "Random views (default: 72)");
    verb.add_option("--seed", o.seed, "Of the random views, displays and backgrounds (default: drawn anew, and told)")
        ->type_name("N");
    verb.add_flag("--quick", o.quick, "Few views: rough figures");
    verb.callback([&o] {
        o.inputs = o.meshes;
        o.inputs.insert(o.inputs.end(), o.others.begin(), o.others.end());
    });
}

void add_scenes_options(CLI::App& verb, ScenesOptions& o) {
    verb.add_option("SCENE", o.inputs,
                    "Scenes with cameras (default: museum, treasure, house and forest of 'unseen make scene')")
        ->type_name("SCENE.glb");
    add_value(verb, "--triangles", o.triangles,
              whole(static_cast<double>(MakeSceneOptions::least_triangles),
                    static_cast<double>(MakeSceneOptions::most_triangles)),
              "N", "Of each of the default scenes, about (default: 500000)");
    add_window_option(verb, o.window_px, "Its side (default: 512)");
    verb.add_flag("!--no-shadows", o.has_shadows, "No light casts shadows");
    verb.add_flag("--quick", o.quick, "Fewer samples a pixel, and a short walk");
}

void add_selection_options(CLI::App& verb, SelectionOptions& o) {
    verb.add_option("SCENE", o.scenes, "Scenes (default: spheres, bunnies and models of 'unseen make scene')")
        ->type_name("SCENE.glb");
    CLI::Option* selections =
        verb.add_option("--selection", o.selections, "Of each scene, in their order (default: made here)")
            ->type_name("FILE.sel")
            ->allow_extra_args(false);
    const auto qualities = std::make_shared<std::vector<std::string>>();
    add_value(verb, "--quality", *qualities, one_of({"ssim", "pixels", "contrast"}), "NAME",
              "What selected levels lose least of: ssim (default), pixels or contrast; may be given again, and "
              "each is flown")
        ->allow_extra_args(false)
        ->excludes(selections);
    add_value(verb, "--spacing", o.spacing, positive(), "X",
              "Of the search's corners, world units (default: a tenth of the scene's longer side)")
        ->excludes(selections);
    add_value(verb, "--window", o.window_px, whole(11, 8192), "PIXELS",
              "Of the search's cameras, a side (default: 256)")
        ->excludes(selections);
    verb.add_option("--mesh", o.statues, "A statue of the default scenes; may be given again")
        ->type_name("FILE")
        ->allow_extra_args(false);
    add_value(verb, "--triangles", o.budget, whole(1, 1e9), "N", "The budget (default: 300000)");
    add_value(verb, "--frames", o.frames, whole(2, 100000), "N", "Of the flight (default: 1000)");
    add_value(verb, "--every", o.judged_every, whole(1, 100000), "N",
              "Frames of which one is drawn and judged (default: 10)");
    add_value(verb, "--size", o.size, whole(16, 8192), "W H",
              "Of the frames (default: 640 360; the thesis has 1920 1080)");
    add_value(verb, "--samples", o.samples, whole(1, 256), "N", "A pixel (default: 4)");
    verb.add_flag("--quick", o.quick, "Few frames, one sample a pixel");
    verb.callback([&o, qualities] {
        for (const auto* files : {&o.scenes, &o.selections, &o.statues})
            o.inputs.insert(o.inputs.end(), files->begin(), files->end());
        if (o.quick) o.judged_every = 100, o.samples = 1;
        if (qualities->empty()) return;
        using session::SelectionQuality;
        o.qualities = {SelectionQuality::ssim, SelectionQuality::pixels, SelectionQuality::contrast};
        std::erase_if(o.qualities, [&](SelectionQuality quality) {
            return std::ranges::find(*qualities, name_of(quality)) == qualities->end();
        });
    });
}

void add_accuracy_options(CLI::App& verb, AccuracyOptions& o) {
    verb.add_option("MODEL", o.inputs,
                    "Meshes, trees and scenes (default: the meshes that are installed, and the scenes of 'unseen make "
                    "scene')")
        ->type_name("MODEL");
    verb.add_flag("--scenes", o.has_scenes, "Besides MODEL, the scenes of 'unseen make scene'");
    verb.add_option("--csv", o.csv, "One line a point")->type_name("FILE.csv");
    verb.add_option("--plots", o.plots,
                    "A folder for a plot of each axis, accuracy_AXIS.png, and for pictures of the axis corners, "
                    "corners_MODEL.png")
        ->type_name("FOLDER");
    const std::vector<std::string> keys = accuracy_axis_keys();
    add_value(verb, "--only", o.only, one_of(keys), "AXIS",
              "These axes alone, of " + listed(keys) + "; may be given again (default: all)");
    add_value(verb, "--seconds", o.seconds, positive(), "T",
              "For the ways to fold of each model, at most (default: 300)");
    add_window_option(verb, o.window_px, "Its side (default: 512)");
    verb.add_flag("--brief", o.is_brief, "Print the first table alone: what the defaults buy and cost");
    verb.add_flag("--quick", o.quick, "Fewer nodes of each tree, which takes less time");
    verb.callback([&o, keys] {
        o.outputs = {o.csv};
        if (o.plots.empty()) return;
        const auto add = [&](const std::string& name) {
            o.outputs.push_back((std::filesystem::path(o.plots) / name).string());
        };
        for (const std::string& key : o.only.empty() ? keys : o.only) add(accuracy_picture_name(key));
        if (!o.only.empty() && std::ranges::find(o.only, "corners") == o.only.end()) return;
        for (const std::string& file : o.inputs) add(corner_sheet_name(std::filesystem::path(file).stem().string()));
        if (o.inputs.empty())
            for (const char* const model : corner_models) add(corner_sheet_name(model));
    });
}

void add_budget_options(CLI::App& verb, QualityOptions& o) {
    verb.add_option("MODEL", o.inputs, "Meshes or trees (default: models with seams or hard edges, made and installed)")
        ->type_name("TREE.vdt|MESH");
    add_value(verb, "--plot", o.plot, ending_in({".png"}), "PLOT.png",
              "SSIM and V against triangles, in the first view");
    add_value(verb, "--sheet", o.sheet, ending_in({".png"}), "SHEET.png",
              "A twentieth of the triangles in the first view: full, ours, meshoptimizer's");
    add_window_option(verb, o.window_px, "Its side (default: 512)");
    verb.add_flag("--quick", o.quick, "The first view alone");
    verb.callback([&o] { o.outputs = {o.plot, o.sheet}; });
}

std::vector<Command> verbs(CLI::App& app) {
    return {
        bench_verb(app, "engine", "Cuts, budgets, memory and building, against what is promised",
                   "The machine should be idle. Building the largest trees takes minutes; --keep spares that the next "
                   "time.\n\nExamples:\n  unseen-bench engine --quick\n"
                   "  unseen-bench engine --mesh dragon.ply --keep /tmp/bench --json engine.json",
                   bench_engine, add_engine_options),
        bench_verb(
            app, "perception", "What fold tests save, and whether it can be seen, against what is promised",
            "Pictures are drawn with 64 samples a pixel; all of it takes about half an hour without a graphics "
            "card.\n\nExamples:\n  unseen-bench perception --quick\n"
            "  unseen-bench perception --mesh bunny.ply horse.ply armadillo.ply gargoyle.ply --json perception.json\n"
            "  unseen-bench perception --only far,hard",
            bench_perception, add_perception_options),
        bench_verb(app, "lod", "What levels of detail show at their distances, beside meshoptimizer's",
                   "Examples:\n  unseen-bench lod\n  unseen-bench lod bunny.ply horse.ply --markdown", bench_lod,
                   [](CLI::App& verb, BenchOptions& o) {
                       verb.add_option("MODEL", o.inputs,
                                       "Meshes or trees (default: models with seams or hard edges, made and installed)")
                           ->type_name("TREE.vdt|MESH");
                   }),
        bench_verb(app, "quality", "What pictures of budgets show, beside meshoptimizer's with as many triangles",
                   "Examples:\n  unseen-bench quality bunny.ply part.stl --plot quality.png\n"
                   "  unseen-bench quality --quick --json quality.json",
                   bench_quality, add_budget_options),
        bench_verb(app, "fit",
                   "What other values of the fold model's factors keep and show, on meshes that are no evidence",
                   "Examples:\n  unseen-bench fit --quick --factor contact_reach\n  unseen-bench fit --json fit.json",
                   bench_fit,
                   [](CLI::App& verb, FitOptions& o) {
                       add_value(verb, "--factor", o.factor, one_of(fit_factors()), "NAME",
                                 "That one alone (default: each, one after the other)");
                       verb.add_flag("--quick", o.quick, "Few views of small meshes: rough figures");
                   }),
        bench_verb(app, "people", "How observers and models of sight compare with people's thresholds, and their fit",
                   "Examples:\n  unseen-bench people\n  unseen-bench people --channels\n"
                   "  unseen-bench people --table mine.csv --json -",
                   bench_people,
                   [](CLI::App& verb, PeopleOptions& o) {
                       verb.add_flag("--channels", o.channels,
                                     "Instead: what judges see of gratings at thresholds of luminance and of colour");
                       add_value(verb, "--table", o.inputs, CLI::Validator(CLI::ExistingFile).description(""),
                                 "FILE.csv", "The thresholds (default: data/people in the checkout)")
                           ->expected(1);
                   }),
        bench_verb(app, "scenes", "What occlusion saves in scenes, and what discrete levels of detail make of the same",
                   "Examples:\n  unseen-bench scenes --quick\n"
                   "  unseen-bench scenes mine.glb --window 1024 --json scenes.json",
                   bench_scenes, add_scenes_options),
        bench_verb(
            app, "selection",
            "What a flight shows of levels selected beforehand, of switching by area and distance, and of the tree's "
            "budget",
            "Examples:\n  unseen-bench selection --quick\n"
            "  unseen-bench selection --mesh bunny.ply --mesh dragon.ply --mesh armadillo.ply\n"
            "  unseen-bench selection --quality ssim --quality pixels\n"
            "  unseen-bench selection mine.glb --selection mine.sel --every 1 --size 1920 1080 --json flight.json",
            bench_selection, add_selection_options),
        bench_verb(app, "accuracy", "What accuracy costs: error against cost for each choice",
                   "Examples:\n  unseen-bench accuracy --quick\n"
                   "  unseen-bench accuracy mine.glb part.stl --csv accuracy.csv\n"
                   "  unseen-bench accuracy bunny.ply --only spheres --only facing --plots plots",
                   bench_accuracy, add_accuracy_options),
        bench_verb(app, "libraries", "OpenMesh's clusterer beside ours, and what CGAL's repair does to meshes",
                   "Examples:\n  unseen-bench libraries teapot.obj bunny.ply", bench_libraries,
                   [](CLI::App& verb, BenchOptions& o) {
                       verb.add_option("MESH", o.inputs, "Meshes as they come")->required()->type_name("MESH");
                   })};
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
    return run_program(argc, argv, {"unseen-bench", about, examples, UNSEEN_VERSION, {}},
                       [](CLI::App& app) { return verbs(app); });
}
