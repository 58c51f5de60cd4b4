// unseen view: a window in which the cut follows the eye.
#include <filesystem>
#include <memory>

#include "options.h"
#include "output_files.h"
#include "session_options.h"
#include "terminal.h"
#include "verbs.h"
#include "viewer.h"
#include "viewer_text.h"

namespace unseen::app {
namespace {

struct ViewArguments {
    ViewOptions& view;
    DisplayOptions& display;
    std::string model = {};
    GazeOptions gaze = {};
    ViewerOptions viewer = {};
};

Result<int> run(ViewArguments& a) {
    std::vector<std::string> inputs = inputs_of(a.model, a.view, a.display);
    inputs.push_back(a.gaze.trace);
    if (const auto ready = check_outputs(inputs, {a.viewer.screenshot}); !ready) return ready.error();
    auto gaze = session::GazePlayer::create(a.gaze);
    if (!gaze) return gaze.error();
    a.viewer.model = printable(std::filesystem::path(a.model).filename().string());
    // Not to be seen before there is something to see.
    auto window = render::Context::window(
        {.width = a.view.width, .height = a.view.height, .title = a.viewer.model + " - Unseen", .visible = false});
    if (!window) return window.error();
    auto session = open_session(a.model, a.view, a.display);
    if (!session) return session.error();
    session->set_velocity(a.viewer.what.velocity());
    a.viewer.first_view = make_view(*session, a.view);
    a.viewer.has_fixed_field = a.view.fov_degrees.has_value() || session->scene().camera.has_value();
    a.viewer.gaze_source = a.gaze.source;
    if (auto ended = run_viewer(*window, *session, std::move(*gaze), a.viewer); !ended) return ended.error();
    return exit_done;
}

} // namespace

Command view_command(CLI::App& app, Setup& setup) {
    auto a = std::make_shared<ViewArguments>(ViewArguments{setup.view_options(), setup.display_options()});
    CLI::App* verb = app.add_subcommand("view", "Look at a model or a scene in a window");
    add_model_option(*verb, a->model);
    verb->add_flag("--wireframe", a->viewer.draw.wireframe, "Begin with the triangles' edges");
    add_value(*verb, "--screenshot", a->viewer.screenshot, ending_in({".png"}), "OUT.png",
              "Write a picture of the model when the viewer ends");
    add_value(*verb, "--frames", a->viewer.frames, whole(1, 1e6), "N", "End after so many frames, for scripts");
    std::vector<Rule> rules;
    add_geomorph_option(*verb, a->viewer.geomorph_seconds, rules);
    add_what_options(*verb, a->viewer.what, rules);
    add_moving_gaze_options(*verb, a->gaze, true, rules);
    setup.act_in(*verb, Setup::view | Setup::parallel | Setup::model | Setup::scenes);
    verb->footer(viewer_help() + "\nExamples:\n  unseen view bunny.vdt\n"
                                 "  unseen view bunny.vdt --triangles 5000 --wireframe\n"
                                 "  unseen view dragon.vdt --milliseconds 2 --geomorph 0.25\n"
                                 "  unseen view part.stl --orthographic fit --direction 0 -1 0 --up 0 0 1");
    return {verb, [a] { return run(*a); }, std::move(rules)};
}

} // namespace unseen::app
