// unseen make: larger meshes and scenes, to try things out with.
#include <functional>
#include <memory>

#include <subdivide.h>
#include <unseen/meshio/mesh_file.h>

#include "options.h"
#include "output_files.h"
#include "progress_bar.h"
#include "report.h"
#include "session_options.h"
#include "terminal.h"
#include "verbs.h"

namespace unseen::app {
namespace {

struct SubdivideArguments {
    ViewOptions& view;
    std::string mesh = {}, out = {}, json = {};
    SubdivideOptions options = {};
    TriangleCount triangles = {}; // not given: as many as the rounds make
};

Result<vdtree::Mesh> subdivide_with_progress(vdtree::Mesh mesh, const SubdivideArguments& a) {
    ProgressBar bar("subdividing");
    SubdivideOptions options = a.options;
    options.progress = std::ref(bar);
    if (a.triangles.is_given()) options.triangles = a.triangles.of(mesh.triangles.size());
    return subdivide(std::move(mesh), options);
}

Result<void> write(const std::string& file, const vdtree::Mesh& mesh) {
    ProgressBar bar("writing " + file);
    return meshio::write_mesh(file, mesh.view(), std::ref(bar));
}

Result<int> run(const SubdivideArguments& a) {
    if (const auto ready = check_outputs({a.mesh}, {a.out, a.json}); !ready) return ready.error();
    auto report = JsonReport::open(a.json);
    if (!report) return report.error();
    auto read = read_mesh_file(a.mesh, a.view.texture.skips_bad);
    if (!read) return read.error();
    if (read->document && !read->document->arrays.empty())
        print_note(a.mesh + ": values of vertices are left out of what is made.");
    const std::uint64_t before = read->mesh.triangles.size();
    const auto mesh = subdivide_with_progress(std::move(read->mesh), a);
    if (!mesh) return mesh.error();

    const Json json = {
        {"source_triangles", before}, {"triangles", mesh->triangles.size()}, {"vertices", mesh->positions.size()}};
    if (auto ok = report->prepare(json); !ok) return ok.error();
    if (auto ok = write(a.out, *mesh); !ok) return ok.error();
    if (auto ok = report->publish(); !ok) return ok.error();
    if (report->is_on_stdout()) return exit_done;
    print_line("made " + grouped(mesh->triangles.size()) + " triangles of " + grouped(before) + ", with " +
               grouped(mesh->positions.size()) + " vertices");
    print_written({a.out, a.json});
    return exit_done;
}

Command subdivide_command(CLI::App& make, Setup& setup) {
    auto a = std::make_shared<SubdivideArguments>(SubdivideArguments{setup.view_options()});
    CLI::App* verb =
        make.add_subcommand("subdivide", "Split the triangles of a mesh into smaller ones, a little rough");
    verb->add_option("MESH", a->mesh, "PLY, OBJ, OFF, STL, glTF or VTP")->required()->type_name("FILE");
    verb->add_option("-o,--output", a->out, "The larger mesh")
        ->type_name("OUT.ply|.obj|.glb")
        ->required()
        ->check(ending_in({".ply", ".obj", ".glb"}));
    CLI::Option* times = verb->add_option("--times", a->options.times, "Make four of every triangle, N times")
                             ->type_name("N")
                             ->check(whole(0, most_subdivisions));
    CLI::Option* triangles = add_triangles_option(
        *verb, a->triangles,
        "Instead: up to N triangles, or P% of the mesh's; the last round splits the longest edges alone");
    verb->add_option("--noise", a->options.noise,
                     "How far new vertices may move, as a share of their edge's length, 0..1 (default: 0.02)")
        ->type_name("SHARE")
        ->check(within(0, 1));
    add_json_option(*verb, a->json);
    setup.act_in(*verb, Setup::skip_bad);
    verb->callback([=] {
        if (times->count() + triangles->count() != 1) refuse("give either --times or --triangles.");
    });
    verb->footer("A closed mesh stays closed, and the result depends on the mesh and the options alone.\n\n"
                 "Examples:\n  unseen make subdivide dragon.ply -o dragon_14m.ply --times 2\n"
                 "  unseen make subdivide dragon.ply -o dragon_28m.ply --triangles 28000000 --noise 0.01");
    return {verb, [a] { return run(*a); }};
}

} // namespace

Command make_command(CLI::App& app, Setup& setup) {
    CLI::App* verb = app.add_subcommand("make", "Make larger meshes, and scenes, to try things out with");
    verb->require_subcommand(1);
    const Command subdivide = subdivide_command(*verb, setup), scene = make_scene_command(*verb);
    verb->footer("Examples:\n  unseen make subdivide dragon.ply --times 2 -o dragon_14m.ply\n"
                 "  unseen make scene museum -o museum.glb --bars-per-metre 12\n\n"
                 "'unseen make PART --help' explains a part.");
    return {verb, [=] { return subdivide.parser->parsed() ? subdivide.run() : scene.run(); }};
}

} // namespace unseen::app
