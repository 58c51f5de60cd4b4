// unseen simplify: a cut of a tree as a mesh of its own.
#include <deque>
#include <limits>
#include <memory>

#include <unseen/meshio/mesh_file.h>
#include <unseen/meshio/scene_file.h>
#include <unseen/vdtree/internal/stopwatch.h>

#include "cut_report.h"
#include "on_gpu.h"
#include "output_files.h"
#include "report.h"
#include "session_options.h"
#include "terminal.h"
#include "verbs.h"

namespace unseen::app {
namespace {

struct SimplifyArguments {
    ViewOptions& view;
    DisplayOptions& display;
    std::string model = {}, out = {}, json = {};
    WhatOptions what = {};
    bool is_verbose = false;
};

bool is_gltf(const std::string& file) { return has_ending(file, ".glb") || has_ending(file, ".gltf"); }

// The background goes whole.
Result<std::vector<Message>> write_scene(const std::string& file, const session::Scene& scene,
                                         const std::vector<vdtree::Cut>& cuts) {
    std::vector<meshio::LevelCuts> all;
    for (std::size_t i = 0; i < cuts.size(); ++i)
        all.push_back({scene.objects[i].node, scene.objects[i].mesh, {&cuts[i]}, {0}});
    std::deque<vdtree::Cut> whole;
    for (const session::Object& part : scene.backdrop) {
        whole.emplace_back(part.tree).unfold_all();
        all.push_back({part.node, part.mesh, {&whole.back()}, {0}});
    }
    auto written = meshio::write_scene(file, *scene.source, all);
    if (!written) return written.error();
    return std::move(written->notes);
}

constexpr double nothing_drawn = std::numeric_limits<double>::quiet_NaN();

Result<int> run(const SimplifyArguments& a) {
    auto report = open_report(inputs_of(a.model, a.view, a.display), {a.out}, a.json);
    if (!report) return report.error();
    ViewOptions view = a.view;
    view.measures = a.what.needs_measurement();
    // Other formats hold one mesh.
    if (view.as == session::LoadAs::automatic && !is_gltf(a.out)) view.as = session::LoadAs::model;
    auto session = open_session(a.model, view, a.display);
    if (!session) return session.error();
    session->set_gaze(fixed_gaze(a.what));
    session->set_velocity(a.what.velocity());
    const bool is_scene = session->scene().is_of_file();
    if (is_scene && !is_gltf(a.out))
        return Error{ErrorCode::invalid_argument, "'" + a.model +
                                                      "' is a scene, which only glTF holds: let -o end in "
                                                      ".glb or .gltf, or make one mesh of it with --as model."};
    const vdtree::View seen = make_view(*session, view);
    const session::Request request = a.what.request_for(session->triangle_count());
    auto result = simplify_by(a.what, *session, seen, request);
    if (!result) return result.error();
    const auto start = vdtree::Clock::now();
    for (const vdtree::Cut& cut : result->cuts) cut.indices();
    result->extract_ms += vdtree::ms_since(start);
    if (result->stats.triangles == 0 && session->scene().backdrop.empty()) {
        if (!result->stats.is_complete)
            return Error{ErrorCode::invalid_argument,
                         "No triangle is there yet when the time is over: allow more with --milliseconds."};
        if (session->triangle_count() == 0)
            return Error{ErrorCode::invalid_argument, "'" + a.model + "' has no triangle."};
        return Error{ErrorCode::invalid_argument,
                     "No triangle is left, for the model is too small in this view or the budget too low: "
                     "move nearer or allow more triangles."};
    }

    Json json = to_json(*result, nothing_drawn);
    add_scene(json, *session, result->cuts);
    if (auto ok = report->prepare(json); !ok) return ok.error();
    const auto notes =
        is_scene ? write_scene(a.out, session->scene(), result->cuts) : meshio::write_cut(a.out, result->cuts[0]);
    if (!notes) return notes.error();
    for (const std::string& note : *notes) print_note(a.out + ": " + note);
    if (auto ok = report->publish(); !ok) return ok.error();
    if (report->is_on_stdout()) return exit_done;
    print_scene(*session);
    print_line(kept_text(result->stats.triangles, result->source_triangles));
    print_line(visibility_text(*result, session->observer(), a.display, "in this view"));
    print_written({a.out, a.json});
    if (a.is_verbose) print_details(*result, nothing_drawn);
    return exit_done;
}

} // namespace

Command simplify_command(CLI::App& app, Setup& setup) {
    auto a = std::make_shared<SimplifyArguments>(SimplifyArguments{setup.view_options(), setup.display_options()});
    CLI::App* verb = app.add_subcommand("simplify", "Write a simplified mesh, or scene, for a view");
    add_model_option(*verb, a->model);
    add_value(*verb, "-o,--output", a->out, ending_in(meshio::written_endings()),
              "OUT.ply|.obj|.glb|.gltf|.vtp|.stl|.off", "The mesh")
        ->required();
    add_json_option(*verb, a->json);
    add_verbose_option(*verb, a->is_verbose);
    std::vector<Rule> rules;
    add_what_options(*verb, a->what, rules);
    add_hiding_option(*verb, a->what, rules);
    add_check_options(*verb, a->what, rules);
    setup.act_in(*verb, Setup::view | Setup::parallel | Setup::two_eyes | Setup::model | Setup::scenes);
    verb->footer(
        "OUT.glb, .gltf (with its data in OUT.bin) and .obj have what the model's glTF or OBJ file had: nodes, names,\n"
        "materials, texture coordinates. Images in the file stay in it; images and .mtl files beside it are copied\n"
        "to the folder of OUT under their names, where no other file of that name may be.\n\n"
        "In a scene each node gets a mesh of its own, as seen from the view; transforms, materials, lights and the\n"
        "camera stay, and the background is written whole.\n\n"
        "OUT.ply and .vtp have the values of vertices that the model's PLY or VTP file had: vertices that stay\n"
        "keep theirs, others have the mean of those that they stand for, of whole numbers the nearest one's.\n\n"
        "Examples:\n  unseen simplify bunny.vdt -o seen-from-the-right.ply --direction 1 0 0\n"
        "  unseen simplify bunny.vdt -o small.obj --triangles 5000 --json report.json\n"
        "  unseen simplify bunny.vdt -o half.ply --triangles 50%\n"
        "  unseen simplify bunny.vdt -o stage-set.ply --direction 1 0 0 --visibility picture\n"
        "  unseen simplify house.gltf -o small.glb --pixels 2 --drop animations\n"
        "  unseen simplify museum.glb -o seen.glb --triangles 50%\n"
        "  unseen simplify flow.vtp -o small.vtp --triangles 20%\n"
        "  unseen simplify bunny.vdt -o rough.glb --pixels 4 --fold-test displacement");
    const CLI::Option* visibility = verb->get_option("--visibility");
    return {verb,
            [a, visibility] {
                if (visibility->count() > 0) a->what.request.purpose = session::Purpose::picture;
                return run(*a);
            },
            std::move(rules)};
}

} // namespace unseen::app
