// unseen levels: discrete levels of detail in place of cuts, for comparison, and levels selected beforehand.
#include <array>
#include <memory>

#include <unseen/render/internal/layers.h>

#include "level_flight.h"
#include "numbered_pictures.h"
#include "selection_commands.h"
#include "verbs.h"

namespace unseen::app {
namespace {

using session::LevelMethod;
using session::MapRecipe;

struct LevelsArguments {
    ViewOptions& view;
    DisplayOptions& display;
    std::string model = {};
    LevelFlightOptions levels = {};
};

void add_methods(CLI::App& verb, LevelFlightOptions& o) {
    add_choice<LevelMethod, LevelMethod>(
        verb, "--method", o.control.method,
        {{"perceptual", LevelMethod::perceptual},
         {"distance", LevelMethod::distance},
         {"area", LevelMethod::area},
         {"selection", LevelMethod::given}},
        "perceptual (by what the rest of the picture masks, after Drettakis and others "
        "2007; default), distance, area (of the bounding sphere in the picture), or "
        "selection (as 'unseen levels precompute' found them)");
    verb.add_option_function<std::string>(
            "--selection", [&o](const std::string& file) { o.selection = file, o.control.method = LevelMethod::given; },
            "The selections, and so --method selection")
        ->type_name("FILE.sel");
    add_triangles_option(verb, o.what.budget, "With --selection: the budget of a frame (default: the file's)");
    auto& control = o.control;
    verb.add_option("--bias", control.bias,
                    "With distance and area: above 1 finer levels, below 1 coarser ones (default: 1)")
        ->type_name("X")
        ->check(positive());
    verb.add_option("--levels", control.chain.levels, "Most levels of a mesh, the whole one included (default: 6)")
        ->type_name("N")
        ->check(whole(1, session::most_levels));
    verb.add_option("--layers", control.layers, "With perceptual: most layers of depth (default: 5)")
        ->type_name("N")
        ->check(whole(1, render::most_layers));
    add_choice<MapRecipe, MapRecipe>(verb, "--maps", control.maps,
                                     {{"modern", MapRecipe::modern}, {"rpg99", MapRecipe::rpg99}},
                                     "With perceptual: thresholds of the modern judge (default), or as in the paper");
    verb.add_option("--map-block", control.map_block, "With perceptual: one threshold for N x N pixels (default: 1)")
        ->type_name("N")
        ->check(whole(1, 16));
    verb.add_flag("--half-floats", control.half_floats, "With perceptual: keep layers in 16-bit floats");
    verb.add_option("--fade", control.fade_frames,
                    "With --path: for N frames both levels of an object share its pixels (default: 0)")
        ->type_name("N")
        ->check(whole(0, 1000));
}

std::vector<Rule> level_rules() {
    const std::vector<std::string> others = {"--method distance", "--method area", "--method selection", "--selection"};
    const std::string why = "only --method perceptual draws layers and maps";
    return {{"--method selection", Rule::needs_one_of, {"--selection"}, "make one with 'unseen levels precompute'"},
            {"--selection", Rule::excludes, {"--method perceptual", "--method distance", "--method area"}},
            {"--selection", Rule::excludes, {"--levels", "--fold-test", "--chroma"}, "the levels are the file's"},
            {"--triangles", Rule::needs_one_of, {"--selection"}, "--bias gives other methods more or fewer triangles"},
            {"--bias", Rule::needs_one_of, {"--method distance", "--method area"}},
            {"--layers", Rule::excludes, others, why},
            {"--maps", Rule::excludes, others, why},
            {"--map-block", Rule::excludes, others, why},
            {"--half-floats", Rule::excludes, others, why},
            {"--show layers", Rule::excludes, others, why},
            {"--show combinations", Rule::excludes, others, why},
            {"--show maps", Rule::excludes, others, why},
            {"--fps", Rule::needs_one_of, {"--lights"}}};
}

void check(LevelsArguments& a, bool has_fade) {
    LevelFlightOptions& o = a.levels;
    if (a.model.empty()) refuse("TREE is required.");
    if (o.out.empty() && o.json.empty()) refuse("-o is required, or --json.");
    const bool is_picture = has_ending(o.out, ".png");
    if (o.path.empty() && !o.show && parse_pattern(o.out)) o.path = "walk";
    if (o.path.empty()) {
        if (o.show && !is_picture) refuse("--show draws pictures for people: -o must end in .png.");
        if (has_fade) refuse("--fade needs --path: a still picture does not change.");
        return;
    }
    if (o.out.empty()) return;
    if (const auto complaint = complaint_about_picture_names(o.out); !complaint.empty()) refuse(complaint);
}

} // namespace

Command levels_command(CLI::App& app, Setup& setup) {
    auto a = std::make_shared<LevelsArguments>(LevelsArguments{setup.view_options(), setup.display_options()});
    LevelFlightOptions& o = a->levels;
    CLI::App* verb =
        app.add_subcommand("levels", "Draw discrete levels of detail in place of cuts; select levels beforehand");
    add_model_option(*verb, a->model);
    verb->get_option("TREE")->required(false); // the parts have files of their own
    verb->add_option(
            "-o,--output", o.out,
            "The picture in which nothing changes any more: PNG, or PFM or EXR for judging; with --path one for "
            "each frame, FRAMES_%04d.png")
        ->type_name("OUT.png|.pfm|.exr")
        ->check(ending_in({".png", ".pfm", ".exr"}));
    add_choice(*verb, "--show", o.show,
               std::vector<std::pair<std::string, LevelView>>{{"layers", LevelView::layers},
                                                              {"combinations", LevelView::combinations},
                                                              {"maps", LevelView::maps},
                                                              {"levels", LevelView::levels}},
               "In place of the picture: the layers, what is left without each, maps of thresholds for that, or the "
               "levels");
    verb->add_option("--path", o.path, "As in 'unseen fly' (default: a still view)")
        ->type_name("orbit:D[:N]|walk[:V[:N]]|FILE.csv");
    verb->add_option("--fps", o.frames_a_second, "With --lights that move: frames a second (default: 60)")
        ->type_name("N")
        ->check(within(1, 1e6));
    add_json_option(*verb, o.json);
    add_verbose_option(*verb, o.is_verbose);
    add_methods(*verb, o);
    add_fold_test_option(*verb, o.what.request.fold_test, true);
    verb->add_flag("--chroma", o.what.request.chroma, "Levels also keep changes of colour that can be seen");
    add_gaze_option(*verb, o.what.gaze_px);
    add_velocity_option(*verb, o.what.velocity_deg_s);
    setup.act_in(*verb, Setup::view | Setup::parallel | Setup::model | Setup::scenes);
    const Command precompute = precompute_command(*verb, setup), info = selection_info_command(*verb);
    verb->require_subcommand(0, 1);
    verb->callback([=] {
        if (!precompute.parser->parsed() && !info.parser->parsed()) check(*a, !verb->get_option("--fade")->empty());
    });
    verb->footer(
        "Examples:\n  unseen levels museum.glb -o levels.png --show levels --maps rpg99\n"
        "  unseen levels house.glb --method area --bias 0.5 --path orbit:1:90 -o frames/%04d.png --json stats.json\n"
        "  unseen levels precompute spheres.glb --triangles 300k -o spheres.sel\n"
        "  unseen levels spheres.glb --selection spheres.sel --path walk:3:120 --json -");
    return {verb,
            [=]() -> Result<int> {
                if (precompute.parser->parsed()) return precompute.run();
                if (info.parser->parsed()) return info.run();
                if (auto drawn = draw_levels(a->model, a->view, a->display, a->levels); !drawn) return drawn.error();
                return exit_done;
            },
            level_rules()};
}

} // namespace unseen::app
