// unseen make: larger meshes and scenes, to try things out with.
#include <algorithm>
#include <functional>
#include <memory>

#include <make_scene.h>
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

// ---- larger meshes

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
    auto report = open_report({a.mesh}, {a.out}, a.json);
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
    add_value(*verb, "-o,--output", a->out, ending_in({".ply", ".obj", ".glb"}), "OUT.ply|.obj|.glb", "The larger mesh")
        ->required();
    CLI::Option* times = add_value(*verb, "--times", a->options.times, whole(0, most_subdivisions), "N",
                                   "Make four of every triangle, N times");
    CLI::Option* triangles = add_triangles_option(
        *verb, a->triangles,
        "Instead: up to N triangles, or P% of the mesh's; the last round splits the longest edges alone");
    add_value(*verb, "--noise", a->options.noise, within(0, 1), "SHARE",
              "How far new vertices may move, as a share of their edge's length, 0..1 (default: 0.02)");
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

// ---- scenes

struct SceneArguments {
    std::string out, json;
    std::vector<std::string> statues;
    TriangleCount triangles;
    MakeSceneOptions options;
};

Result<int> run(SceneArguments& a) {
    auto report = open_report(a.statues, {a.out}, a.json);
    if (!report) return report.error();
    a.options.statues.assign(a.statues.begin(), a.statues.end());
    const auto made = make_scene(a.out, a.options);
    if (!made) return made.error();
    for (const std::string& sentence : made->left_out) print_note(sentence);
    const Json json = {{"objects", made->objects},
                       {"triangles", made->triangles},
                       {"meshes", made->meshes},
                       {"mesh_triangles", made->mesh_triangles},
                       {"background_triangles", made->background_triangles}};
    if (auto ok = report->write(json); !ok) return ok.error();
    if (report->is_on_stdout()) return exit_done;
    print_line("made " + grouped(made->objects) + (made->objects == 1 ? " object" : " objects") + " of " +
               grouped(made->triangles) + " triangles, and " + grouped(made->background_triangles) +
               " of background; " + grouped(made->meshes) + " different meshes");
    print_written({a.out, a.json});
    return exit_done;
}

CLI::App* add_scene_part(CLI::App& verb, const std::shared_ptr<SceneArguments>& a) {
    CLI::App* make =
        verb.add_subcommand("scene", "Make a scene of many objects, with a camera, lights and a background");
    add_choice<SceneKind, SceneKind>(
        *make, "KIND", a->options.kind,
        {{"museum", SceneKind::museum},
         {"treasure", SceneKind::treasure},
         {"house", SceneKind::house},
         {"forest", SceneKind::forest},
         {"building", SceneKind::building},
         {"spheres", SceneKind::spheres},
         {"bunnies", SceneKind::bunnies},
         {"models", SceneKind::models}},
        "museum: a statue behind a gate, lit through a barred window; treasure: a chamber of statues; "
        "house: a front with columns, statues and a balcony, trees before it; forest: statues among a thousand "
        "trees; building: fifty furnished rooms with doors between them; spheres, bunnies (two of the statues) and "
        "models (all of them): forty objects on a plain, to "
        "select "
        "levels of detail in")
        ->required()
        ->type_name("museum|treasure|house|forest|building|spheres|bunnies|models");
    add_value(*make, "-o,--output", a->out, ending_in({".glb"}), "OUT.glb", "The scene")->required();
    add_triangles_option(
        *make, a->triangles,
        "Roughly N in all objects, shared meshes counted for each, 10,000 to 100,000,000 "
        "(default: museum 0.3, house 1.5, treasure and forest 2, building 5, spheres 1.1, bunnies and models 2.8 "
        "million); a forest has 0.3 million at least")
        ->type_name("N");
    make->add_option("--mesh", a->statues,
                     "A statue; may be given again (default: the bunny of Debian's package glmark2-data, where it is "
                     "installed). Those with more triangles than a statue may have are left out; the others are made "
                     "here. Bunnies and models take the first two or four, simplified where they have more")
        ->type_name("FILE")
        ->allow_extra_args(false);
    CLI::Option* spacing = add_value(*make, "--bars-per-metre", a->options.bars_per_metre, within(1, 100), "N",
                                     "In the museum (default: 8)");
    CLI::Option* bars = add_choice<MuseumBars, MuseumBars>(*make, "--bars", a->options.bars,
                                                           {{"both", MuseumBars::both},
                                                            {"gate", MuseumBars::gate},
                                                            {"window", MuseumBars::window},
                                                            {"none", MuseumBars::none}},
                                                           "In the museum: both (default), gate, window or none");
    add_seed_option(*make, a->options.seed, "For what is strewn about");
    add_json_option(*make, a->json);
    make->callback([a, bars, spacing] {
        if (a->options.kind != SceneKind::museum && (*bars || *spacing))
            refuse("--bars and --bars-per-metre act in the museum alone.");
        if (a->triangles.share > 0) refuse("--triangles: must be a number here, not a share.");
        a->options.triangles = a->triangles.triangles;
        if (a->options.triangles != 0 && (a->options.triangles < MakeSceneOptions::least_triangles ||
                                          a->options.triangles > MakeSceneOptions::most_triangles))
            refuse("--triangles: from 10,000 to 100,000,000.");
    });
    return make;
}

Command make_scene_command(CLI::App& make) {
    auto a = std::make_shared<SceneArguments>();
    CLI::App* verb = add_scene_part(make, a);
    verb->footer("Examples:\n  unseen make scene museum -o museum.glb --bars-per-metre 12\n"
                 "  unseen make scene museum -o open.glb --bars none --mesh dragon.ply\n"
                 "  unseen make scene forest -o forest.glb --triangles 10M --seed 7\n"
                 "  unseen render museum.glb -o museum.png\n"
                 "  unseen simplify forest.glb -o seen.glb --triangles 5%");
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
