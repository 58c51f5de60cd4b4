// unseen demo: a first look without a model of one's own.
#include <functional>
#include <memory>
#include <optional>

#include "cut_report.h"
#include "demo.h"
#include "load_model.h"
#include "output_files.h"
#include "progress_bar.h"
#include "session_options.h"
#include "sheet_report.h"
#include "terminal.h"
#include "verbs.h"
#include "viewer.h"

namespace unseen::app {
namespace {

struct DemoArguments {
    ViewOptions& view;
    std::string folder = "unseen-demo";
    bool is_made = false, is_without_view = false;
    int frames = 0;
};

Result<Demo> make(session::Session& session, const DemoModel& model, DemoFiles& files) {
    auto context = render::Context::headless();
    if (!context) print_note("pictures are left out: " + context.error().message);
    ProgressBar bar("drawing and judging");
    return make_demo(session, context ? &*context : nullptr, model, files, std::ref(bar));
}

Result<void> view(session::Session& session, const DemoModel& model, int frames) {
    ViewerOptions options;
    options.model = model.name;
    options.first_view = session.default_view();
    options.frames = frames;
    auto window = render::Context::window({.width = options.first_view.width,
                                           .height = options.first_view.height,
                                           .title = model.name + " - Unseen",
                                           .visible = false});
    if (!window) return window.error();
    auto gaze = session::GazePlayer::create({});
    if (!gaze) return gaze.error();
    return run_viewer(*window, session, std::move(*gaze), options);
}

Result<int> run(const DemoArguments& a) {
    const auto model = demo_model(a.folder, a.is_made);
    if (!model) return model.error();
    DemoFiles files = demo_files(a.folder, *model);
    if (const auto ready = check_outputs({}, files.names()); !ready) return ready.error();
    print_line("the model: " + model->what + "; its tree is built now, if it is not kept from before");
    auto session = open_session(model->mesh, a.view, {});
    if (!session) return session.error();
    const auto demo = make(*session, *model, files);
    if (!demo) return demo.error();
    print_line(kept_text(demo->imperceptible.stats.triangles, demo->imperceptible.source_triangles));
    print_line(visibility_text(demo->imperceptible, session->observer(), {}, "in the default view"));
    if (!demo->cuts.empty()) print_sheet(demo->cuts);
    print_written(files.names());
    const bool has_window = !a.is_without_view && has_display();
    print_line((has_window ? "to look around again:  unseen view "
                           : "to look around, where there is a display:  unseen view ") +
               files.tree.string());
    print_line("the same with a mesh of your own:  unseen simplify MESH -o small.glb");
    if (!has_window) return exit_done;
    print_line("the viewer is open; h shows its keys, q ends it");
    if (auto shown = view(*session, *model, a.frames); !shown) print_note("no viewer: " + shown.error().message);
    return exit_done;
}

} // namespace

Command demo_command(CLI::App& app, Setup& setup) {
    auto a = std::make_shared<DemoArguments>(DemoArguments{setup.view_options()});
    CLI::App* verb = app.add_subcommand("demo", "A first look: a model, simplified, drawn and shown; needs no file");
    verb->add_option("-o,--output", a->folder, "Where its files go (default: unseen-demo)")->type_name("FOLDER");
    verb->add_flag("--made", a->is_made, "A model that is made, even where the bunny is installed");
    verb->add_flag("--no-view", a->is_without_view, "Open no window");
    verb->add_option("--frames", a->frames, "End the viewer after so many frames, for scripts")
        ->type_name("N")
        ->check(whole(1, 1e6));
    setup.act_in(*verb, Setup::cache);
    verb->footer(
        "The model is the Stanford bunny, where Debian's package glmark2-data is installed, or else a ball with\n"
        "bumps. Written are its tree, what nobody sees gone, and two sheets of pictures; then the viewer opens,\n"
        "where there is a display. With --no-cache the tree is kept nowhere but in the folder.\n\n"
        "Examples:\n  unseen demo\n  unseen demo -o first-look --no-view");
    return {verb, [a] { return run(*a); }};
}

} // namespace unseen::app
