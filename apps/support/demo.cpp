#include "demo.h"

#include <cstdlib>
#include <system_error>

#include <unseen/meshio/mesh_file.h>
#include <unseen/perception/image.h>
#include <unseen/vdtree/tree_io.h>

#include "sample_mesh.h"

namespace unseen::app {
namespace {

namespace fs = std::filesystem;

constexpr const char* bunny = "/usr/share/glmark2/models/bunny.obj";
constexpr int ball_rows = 120; // 57,600 triangles

} // namespace

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

DemoFiles demo_files(const fs::path& folder, const DemoModel& model) {
    return {folder / (model.name + ".vdt"), folder / (model.name + "_small.ply"), folder / (model.name + "_sheet.png"),
            folder / (model.name + "_maps.png")};
}

Result<Demo> make_demo(session::Session& session, render::Context* context, const DemoModel& model, DemoFiles& files,
                       const Progress& progress) {
    auto small = session.simplify();
    if (!small) return small.error();
    // Only now: the tree has its measurement.
    if (auto ok = vdtree::write_tree(files.tree, session.tree()); !ok) return ok.error();
    if (const auto notes = meshio::write_cut(files.mesh, small->cuts.front()); !notes) return notes.error();
    Demo demo{std::move(*small), {}};
    if (context == nullptr) {
        files.sheet.clear();
        files.maps.clear();
        return demo;
    }
    SheetOptions options;
    options.model = model.name;
    options.has_maps = true;
    options.progress = progress;
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

} // namespace unseen::app
