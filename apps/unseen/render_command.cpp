// unseen render: a picture of a cut, for people or for judging.
#include <iterator>
#include <memory>

#include <unseen/perception/image.h>
#include <unseen/render/renderer.h>
#include <unseen/session_gpu/frame_image.h>
#include <unseen/session_gpu/scene_renderer.h>

#include "cut_report.h"
#include "fly_through.h"
#include "fold_map.h"
#include "level_flight.h"
#include "numbered_pictures.h"
#include "output_files.h"
#include "report.h"
#include "session_options.h"
#include "terminal.h"
#include "verbs.h"
#include "visibility.h"

namespace unseen::app {
namespace {

// With fewer, an outline that moves by a fiftieth of a pixel changes a whole sample of some pixel: by more than can be
// seen.
constexpr int samples_to_judge = 64;

enum class Method { tree, perceptual, distance, area, selection };

// What --show draws instead of the picture.
struct Shown {
    std::optional<FoldMap> map;
    std::optional<LevelPicture> levels;
};

struct RenderArguments {
    std::string model, out, json;
    ViewOptions view;
    DisplayOptions display;
    WhatOptions what;
    bool is_verbose = false;
    render::DrawOptions draw;
    Shown show;
    FlyThroughOptions flight; // where a path is given
    Method method = Method::tree;
    LevelFlightOptions levels; // of the other methods
};

bool is_for_people(const std::string& file) { return has_ending(file, ".png"); }

Json shadows_json(const render::ShadowFacts& shadows, const session::Session& session) {
    const auto& lights = *session.scene().lights;
    return {{"casting_lights", lights.casting()},
            {"of_lights", lights.light_count()},
            {"maps", shadows.maps},
            {"map_size", shadows.size},
            {"bytes", shadows.bytes},
            {"draw_ms", shadows.draw_ms}};
}

Result<int> run_flight(RenderArguments& a) {
    a.flight.pictures = a.out;
    a.flight.json = a.json;
    a.flight.what = a.what;
    a.flight.draw = a.draw;
    a.flight.is_verbose = a.is_verbose;
    if (auto flown = fly_through(a.model, a.view, a.display, a.flight); !flown) return flown.error();
    return exit_done;
}

Result<int> run_levels(RenderArguments& a) {
    a.levels.control.method = a.method == Method::distance    ? session::LevelMethod::distance
                              : a.method == Method::area      ? session::LevelMethod::area
                              : a.method == Method::selection ? session::LevelMethod::given
                                                              : session::LevelMethod::perceptual;
    a.levels.path = a.flight.path;
    a.levels.out = a.out;
    a.levels.json = a.json;
    a.levels.show = a.show.levels;
    a.levels.frames_a_second = a.flight.frames_a_second;
    a.levels.what = a.what;
    a.levels.is_verbose = a.is_verbose;
    if (auto drawn = draw_levels(a.model, a.view, a.display, a.levels); !drawn) return drawn.error();
    return exit_done;
}

Result<int> run(RenderArguments& a) {
    if (a.method != Method::tree) return run_levels(a);
    if (!a.flight.path.empty()) return run_flight(a);
    if (const auto ready = check_outputs(inputs_of(a.model, a.view, a.display), {a.out, a.json}); !ready)
        return ready.error();
    const auto gaze = session::GazePlayer::create(a.flight.gaze);
    if (!gaze) return gaze.error();
    auto report = JsonReport::open(a.json);
    if (!report) return report.error();
    auto context = render::Context::headless();
    if (!context) return context.error();
    a.view.measures = a.what.needs_measurement();
    auto session = open_session(a.model, a.view, a.display);
    if (!session) return session.error();
    const vdtree::View view = make_view(*session, a.view);
    session->set_gaze(gaze->at(0, view, a.what.gaze_px));
    session->set_velocity(a.what.velocity());
    session::Request request = a.what.request_for(session->triangle_count());
    request.purpose = session::Purpose::picture;
    if (a.show.map && session->scene().objects.size() != 1)
        return Error{ErrorCode::invalid_argument, "--show is of one object, and the scene has " +
                                                      grouped(session->scene().objects.size()) +
                                                      ": leave it out, or give --as model."};
    const auto result = simplify_by(a.what, *session, view, request, &*context);
    if (!result) return result.error();

    auto renderer = session::SceneRenderer::create(*context, *session);
    if (!renderer) return renderer.error();
    render::DrawOptions options = a.draw;
    options.background = session->background();
    const auto frame = renderer->draw(session::drawn_cuts(result->cuts), view, options);
    if (!frame) return frame.error();

    const perception::Display& display = session->observer().display;
    perception::Image image =
        is_for_people(a.out) ? session::code_image(*frame, display) : session::luminance_image(*frame, display);
    if (a.show.map) {
        auto drawn = draw_fold_map(result->cuts.front(), *session, view, request, *a.show.map, view);
        if (!drawn) return drawn.error();
        image = std::move(*drawn);
    }
    Json json = to_json(*result, frame->draw_ms);
    add_scene(json, *session, result->cuts);
    if (const auto shadows = renderer->shadows()) json["shadows"] = shadows_json(*shadows, *session);
    if (auto ok = report->prepare(json); !ok) return ok.error();
    if (auto ok = perception::write_image(a.out, image); !ok) return ok.error();
    if (auto ok = report->publish(); !ok) return ok.error();
    if (report->is_on_stdout()) return exit_done;
    print_scene(*session);
    print_line(kept_text(result->stats.triangles, result->source_triangles));
    print_line(visibility_text(*result, session->observer(), a.display, "in this view"));
    print_written({a.out, a.json});
    if (a.is_verbose) {
        print_details(*result, frame->draw_ms);
        print_line("drawn by " + context->renderer_name());
    }
    return exit_done;
}

void add_path_options(CLI::App& verb, FlyThroughOptions& o) {
    CLI::App& group =
        *verb.add_option_group("PATH", "A fly-through, with one cut that follows the camera; drawn with -o alone");
    group
        .add_option("--path", o.path,
                    "orbit:DEGREES[:FRAMES], around the target from VIEW on, so many degrees a frame (default: once "
                    "around); walk[:METRES_A_SECOND[:FRAMES]], from VIEW towards the target (default: 1.5 m/s for 60 "
                    "frames; what a numbered -o takes where there is no --path); or a CSV file with a header line and "
                    "the columns eye_x, eye_y, eye_z, target_x, "
                    "target_y, target_z, optionally up_x, up_y, up_z and gaze_x, gaze_y (pixels)")
        ->type_name("orbit:D[:N]|walk[:V[:N]]|FILE.csv");
    group.add_option("--csv", o.csv, "One line a frame: triangles, changes, node tests, times, uploaded bytes")
        ->type_name("FILE.csv");
    group.add_option("--plot", o.plot, "Times, triangles, changes and uploaded bytes over the frames")
        ->type_name("FILE.png|.svg")
        ->check(ending_in({".png", ".svg"}));
    group.add_flag("--changes", o.judges_changes,
                   "Say whether the cut could be seen changing from frame to frame, although each picture passes; some "
                   "seconds a frame");
    add_geomorph_option(group, o.geomorph_seconds);
    group
        .add_option("--fps", o.frames_a_second,
                    "With --geomorph, --changes, --lights and moving gazes: frames a second of the path (default: 60)")
        ->type_name("N")
        ->check(within(1, 1e6));
    // Not by its address: the parser takes an optional<bool> for a count and begins with 0.
    group.add_flag_function(
        "--draw,!--no-draw", [&o](std::int64_t count) { o.draws = count > 0; },
        "Draw the frames even where no -o keeps them, to time that");
}

bool is_moving(const GazeOptions& gaze) {
    return gaze.source == GazeSource::trace || gaze.source == GazeSource::simulated;
}

// Of discrete levels.
void check_levels(const RenderArguments& a) {
    const FlyThroughOptions& o = a.flight;
    if (a.show.map) refuse("--show cost, frequency, contrast and eccentricity are of cuts, and exclude --method.");
    if (a.show.levels && *a.show.levels != LevelPicture::levels && a.method != Method::perceptual)
        refuse("--show layers, combinations and maps need --method perceptual.");
    const bool has_budget = a.method == Method::selection && a.what.budget.is_given();
    if (a.what.request.goal.kind != Goal::Kind::imperceptible && !has_budget)
        refuse("--full, --triangles and --pixels are of cuts, and exclude --method: give --bias to have as many "
               "triangles.");
    if (a.what.request.threshold != 1 || o.geomorph_seconds || o.judges_changes || !o.csv.empty() || !o.plot.empty())
        refuse(
            "--threshold, --geomorph, --changes, --csv and --plot are of cuts, and exclude --method; --json says all.");
    if (o.gaze.source != GazeSource::none)
        refuse("--gaze-trace and --gaze-mode are of cuts, and exclude --method: give --gaze.");
    if (a.what.visibility != Visibility::spheres) refuse("--visibility is of cuts, and excludes --method.");
    if (a.draw.wireframe || a.draw.shading != render::Shading::smooth)
        refuse("--wireframe and --shading flat exclude --method.");
    if (a.out.empty() && a.json.empty()) refuse("--method needs -o or --json.");
    if (o.path.empty()) {
        if (a.show.levels && !is_for_people(a.out)) refuse("--show draws pictures for people: -o must end in .png.");
        return;
    }
    if (a.out.empty()) return;
    if (const auto complaint = complaint_about_picture_names(a.out); !complaint.empty()) refuse(complaint);
}

void check(const RenderArguments& a) {
    const FlyThroughOptions& o = a.flight;
    if (a.method != Method::tree) {
        check_levels(a);
        return;
    }
    if (a.show.levels) refuse("--show layers, combinations, maps and levels need --method.");
    if (o.path.empty() && is_moving(o.gaze)) refuse("--gaze-trace and --gaze-mode simulated need --path.");
    check_gaze(a.what, o.gaze);
    check_geomorph(o.geomorph_seconds, a.view);
    const bool may_have_gaze = a.what.gaze_px || o.gaze.source != GazeSource::none || !o.path.empty();
    if (o.gaze.tracker.error_deg > 0 && !may_have_gaze) refuse("--gaze-error needs a gaze: --gaze or --gaze-mode.");
    if (o.path.empty()) {
        if (a.out.empty()) refuse("-o is required (or --path).");
        if (a.show.map && !is_for_people(a.out)) refuse("--show draws pictures for people: -o must end in .png.");
        if (a.show.map == FoldMap::cost && a.what.request.goal.kind == Goal::Kind::full)
            refuse("--show cost and --full exclude each other: nothing is folded.");
        if (a.show.map == FoldMap::contrast && !a.view.lights.empty())
            refuse("--show contrast is of the mesh's own light, and excludes --lights.");
        if (a.show.map == FoldMap::eccentricity && !a.what.gaze_px && o.gaze.source == GazeSource::none)
            refuse("--show eccentricity needs --gaze: without one all counts as looked at.");
        if (!o.csv.empty() || !o.plot.empty() || o.draws || o.geomorph_seconds || o.judges_changes)
            refuse("--csv, --plot, --geomorph, --changes and --draw need --path.");
        return;
    }
    if (a.show.map) refuse("--show is for single pictures, and excludes --path.");
    if (a.what.visibility != Visibility::spheres)
        refuse("--visibility picture is for single pictures, and excludes --path.");
    if (a.what.masks) refuse("--masking scene is for single pictures, and excludes --path.");
    if (o.judges_changes && o.draws && !*o.draws) refuse("--no-draw and --changes exclude each other.");
    if (o.judges_changes && a.draw.wireframe) refuse("--changes are those of the model: leave --wireframe away.");
    if (a.out.empty()) return;
    if (o.draws && !*o.draws) refuse("--no-draw and -o exclude each other.");
    if (const auto complaint = complaint_about_picture_names(a.out); !complaint.empty()) refuse(complaint);
}

void add_level_options(CLI::App& verb, RenderArguments& a) {
    CLI::App& group = *verb.add_option_group(
        "LEVELS", "Discrete levels of detail in place of cuts, for comparison; one sample a pixel");
    add_choice<Method, Method>(group, "--method", a.method,
                               {{"tree", Method::tree},
                                {"perceptual", Method::perceptual},
                                {"distance", Method::distance},
                                {"area", Method::area},
                                {"selection", Method::selection}},
                               "tree (default): cuts. Or levels by what the rest of the picture masks (perceptual, "
                               "after Drettakis and others 2007), by distance, or by the area of the bounding sphere; "
                               "or as 'unseen select' has "
                               "found them, within its budget or --triangles (selection). "
                               "Without --path, the picture in which nothing changes any more");
    group.add_option("--selection", a.levels.selection, "Of selection: what 'unseen select precompute' has written")
        ->type_name("FILE.sel");
    auto& control = a.levels.control;
    group
        .add_option("--bias", control.bias,
                    "Of distance and area: above 1 finer levels, below coarser ones (default: 1)")
        ->type_name("X")
        ->check(positive());
    group
        .add_option("--levels", control.chain.levels,
                    "Levels of each mesh at most, the whole one included (default: 6)")
        ->type_name("N")
        ->check(whole(1, session::most_levels));
    group
        .add_option("--layers", control.layers,
                    "Of perceptual, and of --masking scene: layers of depth at most (default: 5)")
        ->type_name("N")
        ->check(whole(1, render::most_layers));
    add_choice<session::MapRecipe, session::MapRecipe>(
        group, "--maps", control.maps, {{"modern", session::MapRecipe::modern}, {"rpg99", session::MapRecipe::rpg99}},
        "Of perceptual: thresholds by the modern judge (default), or as in the paper");
    group
        .add_option("--map-block", control.map_block,
                    "Of perceptual: a threshold is of so many by so many pixels (default: 1)")
        ->type_name("N")
        ->check(whole(1, 16));
    group
        .add_option("--fade", control.fade_frames,
                    "With --path: for so many frames both levels of an object share its pixels (default: 0)")
        ->type_name("N")
        ->check(whole(0, 1000));
    group.add_flag("--half-floats", control.half_floats, "Of perceptual: keep layers in 16-bit floats");
}

} // namespace

Command render_command(CLI::App& app) {
    auto a = std::make_shared<RenderArguments>();
    CLI::App* verb = app.add_subcommand("render", "Draw a simplification of a model or a scene for a view");
    add_model_option(*verb, a->model);
    verb->add_option("-o,--output", a->out, "PNG for people; PFM or EXR for judging: luminance in cd/m2")
        ->type_name("OUT.png|.pfm|.exr")
        ->check(ending_in({".png", ".pfm", ".exr"}));
    CLI::Option* samples =
        verb->add_option(
                "--samples", a->draw.samples,
                "Samples a pixel, 1 to 256 (default: 16; for what is to be judged, PFM, EXR and --changes: 64; with "
                "--path: 1)")
            ->type_name("N")
            ->check(whole(1, 256));
    verb->add_flag("--wireframe", a->draw.wireframe, "Draw the triangles' edges, too");
    add_choice<render::Shading, render::Shading>(*verb, "--shading", a->draw.shading,
                                                 {{"smooth", render::Shading::smooth}, {"flat", render::Shading::flat}},
                                                 "smooth (default) or flat");
    std::vector<std::pair<std::string, Shown>> maps;
    for (std::size_t i = 0; i < std::size(fold_map_names); ++i)
        maps.emplace_back(fold_map_names[i], Shown{static_cast<FoldMap>(i), {}});
    for (const auto& [name, picture] : {std::pair{"layers", LevelPicture::layers},
                                        {"combinations", LevelPicture::combinations},
                                        {"maps", LevelPicture::maps},
                                        {"levels", LevelPicture::levels}})
        maps.emplace_back(name, Shown{{}, picture});
    add_choice(*verb, "--show", a->show, std::move(maps),
               "Instead of the model, of its folds: cost, frequency or contrast (of their worst gratings), or "
               "eccentricity; with --method the layers, what is left without each, maps of thresholds for that, or the "
               "levels");
    add_json_option(*verb, a->json);
    add_verbose_option(*verb, a->is_verbose);
    add_path_options(*verb, a->flight);
    add_level_options(*verb, *a);
    CLI::Option* frames_a_second = verb->get_option("--fps");
    const std::vector<CLI::Option*> of_levels = {verb->get_option("--bias"),      verb->get_option("--levels"),
                                                 verb->get_option("--layers"),    verb->get_option("--maps"),
                                                 verb->get_option("--map-block"), verb->get_option("--half-floats"),
                                                 verb->get_option("--fade")};
    verb->callback([a, samples, frames_a_second, of_levels] {
        a->what.layers = a->levels.control.layers;
        const bool is_still = a->show.map || a->show.levels || !parse_pattern(a->out);
        if (a->flight.path.empty() && !is_still) a->flight.path = "walk";
        const bool has_levels = a->method != Method::tree;
        for (std::size_t i = 0; i < of_levels.size(); ++i) {
            const bool is_of_all = i == 1 || i + 1 == of_levels.size();
            const bool is_of_masking = i == 2 && a->what.masks;
            const bool has_own = i == 1 && a->method == Method::selection; // levels

            const bool fits = is_of_masking ? true
                              : i == 0      ? a->method == Method::distance || a->method == Method::area
                              : is_of_all   ? has_levels && !has_own
                                            : a->method == Method::perceptual;
            if (!of_levels[i]->empty() && !fits)
                refuse(of_levels[i]->get_name() + (has_own  ? " excludes --method selection: its levels are the file's."
                                                   : i == 0 ? " needs --method distance or area."
                                                   : is_of_all ? " needs --method."
                                                               : " needs --method perceptual."));
        }
        if (a->method == Method::selection && a->levels.selection.empty())
            refuse("--method selection needs --selection FILE.sel: make one with 'unseen select precompute'.");
        if (a->method != Method::selection && !a->levels.selection.empty())
            refuse("--selection needs --method selection.");
        if (a->levels.control.fade_frames > 0 && a->flight.path.empty())
            refuse("--fade needs --path: a still picture does not change.");
        if (has_levels && !samples->empty()) refuse("--samples is of cuts: levels are drawn with one sample a pixel.");
        if (!frames_a_second->empty() && !a->flight.geomorph_seconds && a->view.lights.empty() &&
            !a->flight.judges_changes && !is_moving(a->flight.gaze))
            refuse("--fps needs --geomorph, --changes, --lights, --gaze-trace or --gaze-mode simulated.");
        check(*a);
        if (!samples->empty()) return;
        if (a->flight.judges_changes) a->draw.samples = samples_to_judge;
        else if (!a->flight.path.empty()) a->draw.samples = 1;
        else if (!is_for_people(a->out)) a->draw.samples = samples_to_judge;
    });
    add_as_option(*verb, a->view.as);
    add_view_options(*verb, a->view);
    add_orthographic_option(*verb, a->view);
    add_display_options(*verb, a->display);
    add_what_options(*verb, a->what);
    add_visibility_option(*verb, a->what);
    add_masking_option(*verb, a->what, false);
    add_moving_gaze_options(*verb, a->flight.gaze, false);
    verb->footer(
        "Examples:\n  unseen render bunny.vdt -o bunny.png --wireframe\n"
        "  unseen render bunny.vdt -o full.pfm --full --size 1024x1024\n"
        "  unseen render part.stl -o front.png --orthographic fit --direction 0 -1 0 --up 0 0 1\n"
        "  unseen render museum.glb -o museum.png --json -\n"
        "  unseen render bunny.vdt -o cost.png --gaze 1603 512 --show cost\n"
        "  unseen render bunny.vdt -o aside.pfm --gaze 1603 512 --json -\n"
        "  unseen render dragon.vdt --path orbit:1 --gaze-mode simulated --seed 7 --gaze-error 0.5 --gaze-latency 50\n"
        "  unseen render dragon.vdt --path orbit:1 --csv orbit.csv --plot orbit.png\n"
        "  unseen render dragon.vdt --path flight.csv -o frames/%04d.png --threshold 2\n"
        "  unseen render dragon.vdt -o lit.png --lights lights.json\n"
        "  unseen render dragon.vdt --path orbit:0:240 --lights lights.json --fps 60 --csv light.csv\n"
        "  unseen render dragon.vdt --path orbit:1 -o frames/%04d.png --triangles 20000 --geomorph 0.25 --fps 60\n"
        "  unseen render dragon.vdt --path orbit:1:60 --changes --gaze 1603 512 --csv changes.csv\n"
        "  unseen render museum.glb --method perceptual --maps rpg99 -o levels.png --show levels\n"
        "  unseen render house.glb --method area --bias 0.5 --path orbit:1:90 -o frames/%04d.png --json stats.json\n"
        "  unseen render spheres.glb --method selection --selection spheres.sel --path walk:3:120 --json -");
    return {verb, [a] { return run(*a); }};
}

} // namespace unseen::app
