// unseen demo: a first look without a model of one's own.
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>

#include <unseen/meshio/mesh_file.h>
#include <unseen/perception/image.h>
#include <unseen/vdtree/tree_io.h>

#include "contact_sheet.h"
#include "cut_report.h"
#include "output_files.h"
#include "progress_bar.h"
#include "scene_parts.h"
#include "session_options.h"
#include "sheet_report.h"
#include "terminal.h"
#include "verbs.h"
#include "viewer.h"

namespace unseen::app {
namespace {

namespace fs = std::filesystem;

struct DemoArguments {
    ViewOptions& view;
    std::string folder = "unseen-demo";
    bool is_made = false, is_without_view = false;
    int frames = 0;
};

constexpr const char* bunny = "/usr/share/glmark2/models/bunny.obj";
constexpr int ball_rows = 120; // 57,600 triangles

struct DemoModel {
    std::filesystem::path mesh;
    std::string name; // of files that are made of it
    std::string what; // for people
};

// The Stanford bunny, where Debian's package glmark2-data is installed; without it, or where `is_made` says so, a ball
// with bumps, the same at every time. Makes the folder.
Result<DemoModel> demo_model(const fs::path& folder, bool is_made) {
    std::error_code failure;
    fs::create_directories(folder, failure);
    if (failure)
        return Error{ErrorCode::io_failure,
                     "Cannot make the folder '" + folder.string() + "': " + failure.message() + "; name another one."};
    if (!is_made && fs::is_regular_file(bunny, failure))
        return DemoModel{bunny, "bunny", "the Stanford bunny of Debian's package glmark2-data"};
    DemoModel ball{folder / "ball.ply", "ball", "a ball with bumps, made here"};
    if (auto ok = meshio::write_mesh(ball.mesh, bumpy_sphere(ball_rows).view()); !ok) return ok.error();
    return ball;
}

// What is written of a model, by name.
struct DemoFiles {
    fs::path tree, mesh, sheet, maps;

    DemoFiles(const fs::path& folder, const std::string& name)
        : tree(folder / (name + ".vdt")), mesh(folder / (name + "_small.ply")), sheet(folder / (name + "_sheet.png")),
          maps(folder / (name + "_maps.png")) {}
    std::vector<std::string> names() const { return {tree.string(), mesh.string(), sheet.string(), maps.string()}; }
};

struct Demo {
    session::Report imperceptible;
    std::vector<SheetCut> cuts; // of the sheet; none where there is no OpenGL
};

// Simplifies the session's only object for the default view, draws its cuts, and writes all files. Without OpenGL the
// pictures are left out, and their names emptied.
Result<Demo> make(session::Session& session, const DemoModel& model, DemoFiles& files) {
    auto context = render::Context::headless();
    if (!context) print_note("pictures are left out: " + context.error().message);
    auto small = session.simplify();
    if (!small) return small.error();
    // Only now: the tree has its measurement.
    if (auto ok = vdtree::write_tree(files.tree, session.tree()); !ok) return ok.error();
    if (const auto notes = meshio::write_cut(files.mesh, small->cuts.front()); !notes) return notes.error();
    Demo demo{std::move(*small), {}};
    if (!context) {
        files.sheet.clear();
        files.maps.clear();
        return demo;
    }
    ProgressBar bar("drawing and judging");
    SheetOptions options;
    options.model = model.name;
    options.has_maps = true;
    options.progress = std::ref(bar);
    auto drawn = draw_contact_sheet(session, session.default_view(), *context, options);
    if (!drawn) return drawn.error();
    if (auto ok = perception::write_image(files.sheet, drawn->sheet); !ok) return ok.error();
    if (auto ok = perception::write_image(files.maps, drawn->maps); !ok) return ok.error();
    demo.cuts = std::move(drawn->cuts);
    return demo;
}

bool has_display() {
    for (const char* name : {"WAYLAND_DISPLAY", "DISPLAY"})
        if (const char* display = std::getenv(name); display != nullptr && *display != '\0') return true;
    return false;
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
    DemoFiles files(a.folder, model->name);
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
    add_value(*verb, "--frames", a->frames, whole(1, 1e6), "N", "End the viewer after so many frames, for scripts");
    setup.act_in(*verb, Setup::cache);
    verb->footer(
        "The model is the Stanford bunny, where Debian's package glmark2-data is installed, or else a ball with\n"
        "bumps. Written are its tree, what nobody sees gone, and two sheets of pictures; then the viewer opens,\n"
        "where there is a display. With --no-cache the tree is kept nowhere but in the folder.\n\n"
        "Examples:\n  unseen demo\n  unseen demo -o first-look --no-view");
    return {verb, [a] { return run(*a); }};
}

} // namespace unseen::app
