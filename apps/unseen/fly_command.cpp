// unseen fly: a camera's path through a scene, with one cut that follows it.
#include <memory>

#include "fly_through.h"
#include "numbered_pictures.h"
#include "output_files.h"
#include "verbs.h"

namespace unseen::app {
namespace {

struct FlyArguments {
    ViewOptions& view;
    DisplayOptions& display;
    std::string model = {};
    FlyThroughOptions flight = {};
};

void add_outputs(CLI::App& verb, FlyThroughOptions& o) {
    verb.add_option("-o,--output", o.pictures, "A picture of each frame, with one %d or %04d for its number")
        ->type_name("FRAMES_%04d.png");
    verb.add_option("--csv", o.csv, "A line for each frame: triangles, changes, node tests, times, uploaded bytes")
        ->type_name("FILE.csv");
    verb.add_option("--plot", o.plot, "Times, triangles, changes and uploaded bytes over the frames")
        ->type_name("FILE.png|.svg")
        ->check(ending_in({".png", ".svg"}));
    add_json_option(verb, o.json);
    add_verbose_option(verb, o.is_verbose);
}

std::vector<Rule> fly_rules() {
    const std::string judged = "changes are judged in pictures of the model";
    return {
        {"--fps", Rule::needs_one_of, {"--geomorph", "--changes", "--lights", "--gaze-trace", "--gaze-mode simulated"}},
        {"--no-draw", Rule::excludes, {"-o", "--changes"}, "these draw"},
        {"--wireframe", Rule::needs_one_of, {"-o", "--draw"}},
        {"--samples", Rule::needs_one_of, {"-o", "--draw", "--changes"}},
        {"--changes", Rule::excludes, {"--wireframe"}, judged}};
}

} // namespace

Command fly_command(CLI::App& app, Setup& setup) {
    auto a = std::make_shared<FlyArguments>(FlyArguments{setup.view_options(), setup.display_options()});
    FlyThroughOptions& o = a->flight;
    o.path = "walk";
    CLI::App* verb = app.add_subcommand("fly", "Move through a model or a scene, with one cut that follows the eye");
    add_model_option(*verb, a->model);
    verb->add_option("--path", o.path,
                     "orbit:DEGREES[:FRAMES], around the target, that many degrees a frame (default: once around); "
                     "walk[:METRES_A_SECOND[:FRAMES]], towards the target (default: 1.5 m/s for 60 frames); or a CSV "
                     "file with a header line and the columns eye_x, eye_y, eye_z, target_x, target_y, target_z, "
                     "optionally up_x, up_y, up_z and gaze_x, gaze_y (pixels). Default: walk")
        ->type_name("orbit:D[:N]|walk[:V[:N]]|FILE.csv");
    add_outputs(*verb, o);
    verb->add_flag("--changes", o.judges_changes,
                   "Judge whether the cut can be seen changing from frame to frame, although each picture passes; some "
                   "seconds a frame");
    verb->add_option(
            "--fps", o.frames_a_second,
            "Frames a second of the path, for all that takes time: glides, changes, lights, gazes (default: 60)")
        ->type_name("N")
        ->check(within(1, 1e6));
    // Not by its address: the parser takes an optional<bool> for a count and begins with 0.
    verb->add_flag_function(
        "--draw", [&o](std::int64_t) { o.draws = true; }, "Draw the frames even where no -o keeps them, to time that");
    verb->add_flag_function(
            "--no-draw", [&o](std::int64_t) { o.draws = false; }, "Draw nothing")
        ->excludes(verb->get_option("--draw"));
    o.draw.samples = 1;
    add_samples_option(*verb, o.draw.samples, "1; with --changes 64");
    verb->add_flag("--wireframe", o.draw.wireframe, "Draw the triangles' edges, too");
    std::vector<Rule> rules = fly_rules();
    add_geomorph_option(*verb, o.geomorph_seconds, rules);
    add_what_options(*verb, o.what, rules);
    add_moving_gaze_options(*verb, o.gaze, false, rules);
    setup.act_in(*verb, Setup::view | Setup::parallel | Setup::model | Setup::scenes);
    verb->callback([&o, samples = verb->get_option("--samples")] {
        if (samples->empty() && o.judges_changes) o.draw.samples = samples_to_judge;
        if (o.pictures.empty()) return;
        if (const auto complaint = complaint_about_picture_names(o.pictures); !complaint.empty()) refuse(complaint);
    });
    verb->footer(
        "Examples:\n  unseen fly dragon.vdt --path orbit:1 --csv orbit.csv --plot orbit.png\n"
        "  unseen fly dragon.vdt --path flight.csv -o frames/%04d.png --threshold 2\n"
        "  unseen fly dragon.vdt --path orbit:1 --gaze-mode simulated --seed 7 --gaze-error 0.5 --gaze-latency 50\n"
        "  unseen fly dragon.vdt --path orbit:0:240 --lights lights.json --fps 60 --csv light.csv\n"
        "  unseen fly dragon.vdt --path orbit:1 -o frames/%04d.png --triangles 20k --geomorph 0.25 --fps 60\n"
        "  unseen fly dragon.vdt --path orbit:1:60 --changes --gaze 1603 512 --csv changes.csv\n"
        "  unseen fly museum.glb --path walk:1.5:120 --csv walk.csv --json -");
    return {verb,
            [a]() -> Result<int> {
                if (auto flown = fly_through(a->model, a->view, a->display, a->flight); !flown) return flown.error();
                return exit_done;
            },
            std::move(rules)};
}

} // namespace unseen::app
