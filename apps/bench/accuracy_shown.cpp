// What shows by a choice: of levels' settings, of the age of a gaze, of the steps of the fold measurement.
#include <algorithm>
#include <functional>
#include <optional>

#include <glm/geometric.hpp>

#include <unseen/perception/fold_measurement.h>
#include <unseen/session_gpu/level_control.h>
#include <unseen/session_gpu/picture_judge.h>

#include "accuracy.h"
#include "level_cuts.h"
#include "terminal.h"

namespace unseen::app {
namespace {

// Towards the target at walking speed, at 60 frames a second. Frame 0 is the first view.
vdtree::View view_on_walk(const vdtree::View& first, int frame) {
    const glm::dvec3 way = frame * (1.5 / 60) * glm::normalize(first.target - first.eye);
    vdtree::View view = first;
    view.eye += way;
    view.target += way;
    return view;
}

// The program's own first, and one thing changed in each of the others.
std::vector<std::pair<std::string, session::LevelControlOptions>> level_variants() {
    const session::LevelControlOptions usual;
    return {{"modern, " + std::to_string(usual.layers) + " layers, tested every " +
                 std::to_string(usual.frames_a_layer) + " frames",
             {}},
            {"rpg99", {.maps = session::MapRecipe::rpg99}},
            {"1 layer", {.layers = 1}},
            {"2 layers", {.layers = 2}},
            {"3 layers", {.layers = 3}},
            {"8 layers", {.layers = 8}},
            {"tested every frame", {.frames_a_layer = 1}},
            {"tested every 2 frames", {.frames_a_layer = 2}},
            {"tested every 8 frames", {.frames_a_layer = 8}},
            {"by distance", {.method = session::LevelMethod::distance}},
            {"by area", {.method = session::LevelMethod::area}}};
}

// No pictures of the whole mesh, and so no node that folds by one.
vdtree::VertexTree without_stages(const vdtree::VertexTree& tree) {
    const auto none = require(tree.with_attribute("fold_stages", vdtree::AttributeDomain::tree, std::vector<float>()));
    return require(none.with_attribute("fold_stage", vdtree::AttributeDomain::interior_node,
                                       std::vector<std::uint8_t>(tree.interior_count())));
}

} // namespace

AccuracyPoints level_points(AccuracySubject& subject) {
    constexpr int frames = 12;
    // Each setting is drawn until nothing changes any more, and then walked with: in half of the window.
    vdtree::View first = subject.view;
    first.width = std::max(first.width / 2, 1), first.height = std::max(first.height / 2, 1);
    auto judge = require(
        session::PictureJudge::create(subject.context, subject.session, view_on_walk(first, frames), accuracy_samples));
    AccuracyPoints points;
    for (const auto& [name, how] : level_variants()) {
        auto control = require(session::LevelControl::create(subject.context, subject.session, first, how));
        require(control.settle(first));
        double ms = 0; // a frame on the average: not all frames test
        session::LevelFrame frame;
        std::uint64_t bytes = 0;
        for (int i = 1; i <= frames; ++i) {
            ms += 1e3 / frames * seconds_of([&] {
                      frame = require(control.draw(view_on_walk(first, i)));
                      require(control.wait());
                  });
            bytes = std::max(bytes, frame.texture_bytes);
        }
        const auto verdict = require(judge.judge(level_cuts(subject.session, control, frame)));
        points.push_back({.name = name,
                          .values = {ms, verdict.v, static_cast<double>(frame.triangles),
                                     static_cast<double>(verdict.visible_pixels), static_cast<double>(bytes) / 1e6},
                          .is_default = points.empty()});
    }
    return points;
}

AccuracyPoints gaze_age_points(AccuracySubject& subject) {
    session::Session& session = subject.session;
    // Each gaze asks for criteria of its own, of every object: with many that takes minutes.
    constexpr std::size_t most_objects = 16;
    if (session.scene().objects.size() > most_objects) {
        subject.left_out.push_back("all of it, for it has more than " + std::to_string(most_objects) + " objects.");
        return {};
    }
    const double all = std::max<double>(1, require(session.simplify(subject.view, picture_request())).stats.triangles);
    // By now the viewer looks at the middle; some frames ago, at what is to the right of it.
    const auto gaze_at = [&](double degrees, double margin) {
        return session::Gaze{session::gaze_aside(session.observer().display, subject.view, degrees), margin};
    };
    session.set_gaze(gaze_at(0, 0));
    auto judge = require(session::PictureJudge::create(subject.context, session, subject.view, accuracy_samples));
    AccuracyPoints points;
    const auto add = [&](const std::string& name, std::optional<session::Gaze> gaze) {
        session.set_gaze(gaze);
        const auto made = require(session.simplify(subject.view, picture_request()));
        const auto verdict = require(judge.judge(made.cuts));
        points.push_back(
            {.name = name,
             .values = {made.stats.triangles / all, verdict.v, static_cast<double>(verdict.visible_pixels)},
             .is_default = !gaze});
    };
    constexpr double degrees_a_frame = 30.0 / 60;
    add("no gaze", {});
    add("of this frame", gaze_at(0, 0));
    for (const int frames : {1, 4, 16}) {
        const double degrees = degrees_a_frame * frames;
        const std::string name = std::to_string(frames) + (frames == 1 ? " frame old" : " frames old");
        add(name, gaze_at(degrees, 0));
        add(name + ", margin of " + shortest(degrees) + " deg", gaze_at(degrees, degrees));
    }
    session.set_gaze({});
    return points;
}

// The settings of the measurement are constants (perception/src/measure/measurement.h); here are the steps that can be
// left out.
AccuracyPoints measurement_points(AccuracySubject& subject) {
    // Measured once for each way: larger meshes take too many minutes.
    constexpr vdtree::Index most_triangles = 1'000'000;
    const vdtree::VertexTree& tree = subject.session.tree();
    if (tree.triangle_count() > most_triangles || !tree.texture().empty()) {
        subject.left_out.push_back(tree.texture().empty()
                                       ? "all of it, for it has more than " + grouped(most_triangles) + " triangles."
                                       : "all of it, for it has a texture.");
        return {};
    }
    constexpr double times_as_far = 8;
    vdtree::View far = subject.view;
    far.eye = far.target + times_as_far * (far.eye - far.target);
    const vdtree::View views[] = {subject.view, far};
    std::vector<session::PictureJudge> judges;
    for (const vdtree::View& view : views)
        judges.push_back(
            require(session::PictureJudge::create(subject.context, subject.session, view, accuracy_samples)));
    // Without what is measured of it, which is of the light that was conserved.
    const vdtree::VertexTree plain = tree_like(tree, whole_mesh(tree));
    AccuracyPoints points;
    const auto add = [&](const std::string& name, const std::function<vdtree::VertexTree()>& measure,
                         const std::string& note = {}) {
        const auto start = BenchClock::now();
        vdtree::VertexTree measured = measure();
        const double seconds = seconds_since(start);
        auto session =
            require(session::Session::create(session::Scene::of(std::move(measured)), subject.session.observer()));
        auto renderer = require(session::SceneRenderer::create(subject.context, session));
        double triangles[2];
        session::PictureVerdict seen[2];
        for (const std::size_t i : {0, 1}) {
            const auto made = require(session.simplify(views[i], picture_request()));
            triangles[i] = made.stats.triangles;
            seen[i] = require(
                judges[i].judge(require(renderer.draw(session::drawn_cuts(made.cuts), views[i], judges[i].drawing()))));
        }
        points.push_back({.name = name,
                          .values = {seconds, seen[0].v, triangles[0], static_cast<double>(seen[0].visible_pixels),
                                     triangles[1], seen[1].v},
                          .note = note,
                          .is_default = points.empty()});
    };
    std::optional<vdtree::VertexTree> usual;
    add("the program's, all cores", [&] { return (usual = require(session::measured(plain)))->share(); });
    add(
        "one thread", [&] { return require(session::measured(plain, 1)); }, "the same numbers");
    add(
        "without conserving light", [&] { return require(perception::measure_folds(plain)); },
        "proxies keep the luminance that they were built with");
    add(
        "without stages", [&] { return without_stages(*usual); },
        "what the pictures of the whole mesh add; its time is not told apart");
    points.back().values[0] = points.front().values[0];
    return points;
}

} // namespace unseen::app
