// How cuts are kept, and what they are cuts of.
#include <algorithm>
#include <cmath>
#include <utility>

#include <glm/geometric.hpp>

#include <unseen/session_gpu/picture_judge.h>
#include <unseen/vdtree/criteria.h>

#include "accuracy.h"
#include "peer_simplify.h"
#include "surface_distance.h"
#include "terminal.h"

namespace unseen::app {
namespace {

constexpr double cut_degrees_a_frame = 0.1;
constexpr int settling_frames = 16; // of the first view: what is limited in time comes to rest in them
constexpr int last_frame = settling_frames + accuracy_repeats;

// An eye that stands still for a while, and then goes around.
vdtree::View view_around(const AccuracySubject& subject, int frame) {
    return vdtree::orbited(subject.view, cut_degrees_a_frame * std::max(frame - settling_frames, 0));
}

// Microseconds a frame: a cut that follows an eye around a tree, and its indices.
double follow_us(const vdtree::VertexTree& tree, const vdtree::DistanceCriterion& criterion, const vdtree::View& view) {
    const Pinned pinned;
    constexpr int settling = 2; // the first makes the cut, the second what to watch
    vdtree::Cut cut(tree);
    std::vector<double> times;
    for (int i = 0; i < settling + accuracy_repeats; ++i) {
        const vdtree::View now = vdtree::orbited(view, cut_degrees_a_frame * i);
        const double us = 1e6 * seconds_of([&] {
                              require(cut.follow(criterion, {.eye = vdtree::eye_in_tree(tree, now, {})}));
                              static_cast<void>(cut.indices());
                          });
        if (i >= settling) times.push_back(us);
    }
    return median(std::move(times));
}

// The time of a frame, and how far its triangles are from those of an exact cut from scratch.
AccuracyPoint kept_point(AccuracySubject& subject, const std::string& name, const session::Request& request,
                         bool is_from_scratch) {
    const Pinned pinned;
    session::Request exact = request;
    exact.hysteresis = 1;
    exact.milliseconds.reset();
    session::Follower follower(subject.session);
    std::vector<double> times;
    double error = 0;
    for (int i = is_from_scratch ? settling_frames : 0; i <= last_frame; ++i) {
        const vdtree::View now = view_around(subject, i);
        double triangles = 0;
        const double seconds = seconds_of([&] {
            triangles = is_from_scratch ? require(subject.session.simplify(now, request)).stats.triangles
                                        : require(follower.follow(now, request)).stats.triangles;
        });
        if (i <= settling_frames) continue;
        times.push_back(1e6 * seconds);
        const double truth = require(session::Follower(subject.session).follow(now, exact)).stats.triangles;
        error = std::max(error, std::abs(triangles / std::max(1.0, truth) - 1));
    }
    return {.name = name, .values = {median(std::move(times)), error}};
}

// What one thread makes of several objects, by recipes of the session.
AccuracyPoint cuts_alone(AccuracySubject& subject) {
    std::vector<vdtree::Cut> cuts;
    for (std::size_t i = 0; i < subject.session.scene().objects.size(); ++i) cuts.emplace_back(subject.session.tree(i));
    std::vector<double> times;
    for (int frame = settling_frames; frame <= last_frame; ++frame) {
        std::vector<session::CutRecipe> recipes;
        for (std::size_t i = 0; i < cuts.size(); ++i)
            recipes.push_back(require(subject.session.recipe(view_around(subject, frame), picture_request(), i)));
        const double us =
            1e6 * seconds_of([&] {
                for (std::size_t i = 0; i < cuts.size(); ++i)
                    require(cuts[i].follow(*recipes[i].criterion, recipes[i].viewpoint, recipes[i].options));
            });
        if (frame > settling_frames) times.push_back(us);
    }
    return {.name = "cuts alone, one thread",
            .values = {median(std::move(times)), 0},
            .note = "object by object, without what the session does around them"};
}

session::Session session_of(const vdtree::VertexTree& tree, const AccuracySubject& subject) {
    return require(session::Session::create(session::Scene::of(tree.share()), subject.session.observer()));
}

constexpr double millionths = 1e6;

AccuracyPoint peer_point(const AccuracySubject& subject, const vdtree::Mesh& mesh, vdtree::Index wanted,
                         const session::PictureJudge& judge) {
    vdtree::Mesh simple;
    const double seconds = seconds_of([&] { simple = simplified_by_meshoptimizer(mesh, wanted); });
    const session::Session session =
        session_of(tree_like(subject.session.tree(), simple, {.clusterer = vdtree::ClustererKind::quadric}), subject);
    auto renderer = require(session::SceneRenderer::create(subject.context, session));
    const auto whole = session::whole_cuts(session);
    const auto seen =
        require(judge.judge(require(renderer.draw(session::drawn_cuts(whole), subject.view, judge.drawing()))));
    constexpr double of_vertex = 2 * sizeof(glm::vec3);
    const double vertices_a_triangle =
        static_cast<double>(simple.positions.size()) / static_cast<double>(simple.triangles.size());
    return {.name = "meshoptimizer",
            .values = {seconds, millionths * mean_surface_distance(mesh, simple), seen.v,
                       sizeof(vdtree::Triangle) + of_vertex * vertices_a_triangle},
            .note = grouped(simple.triangles.size()) + " triangles, one mesh for all views"};
}

} // namespace

AccuracyPoints cut_points(AccuracySubject& subject) {
    const bool is_one = subject.session.scene().objects.size() == 1;
    session::Request request = picture_request();
    const vdtree::Index triangles = require(subject.session.simplify(subject.view, request)).stats.triangles;
    AccuracyPoints points = {kept_point(subject, "imperceptible, from scratch", request, true),
                             kept_point(subject, "imperceptible, followed", request, false)};
    points.back().is_default = true;
    for (const double milliseconds : {0.05, 0.2, 1.0}) {
        request.milliseconds = milliseconds;
        points.push_back(
            kept_point(subject, "imperceptible, followed, " + shortest(milliseconds) + " ms at most", request, false));
    }
    if (!is_one) {
        points.push_back(cuts_alone(subject));
        subject.left_out.push_back("budgets with hysteresis, for it has several objects.");
        return points;
    }
    request = picture_request();
    request.goal = session::Goal::budget(std::max<vdtree::Index>(triangles / 2, 1));
    for (const double hysteresis : {1.0, 1.02, 1.1, 1.5, 2.0}) {
        request.hysteresis = static_cast<float>(hysteresis);
        points.push_back(kept_point(
            subject, hysteresis == 1 ? "budget, exact" : "budget, hysteresis " + shortest(hysteresis), request, false));
        points.back().is_default = request.hysteresis == session::Request().hysteresis;
    }
    return points;
}

AccuracyPoints node_test_points(AccuracySubject& subject) {
    const vdtree::VertexTree& tree = subject.session.tree();
    constexpr double tolerance_px = 1;
    const auto criterion = require(vdtree::extent_criterion(tree, subject.view, tolerance_px));
    const glm::dvec3 eye = vdtree::eye_in_tree(tree, subject.view, subject.session.scene().objects[0].placement);
    const double nodes = static_cast<double>(tree.interior_count());
    const Pinned pinned;
    // The twins: what <unseen/vdtree/criteria.h> says, from the tree's floats on.
    std::vector<std::uint8_t> unfolds(tree.interior_count());
    const double switch_distance = static_cast<double>(criterion.parts().switch_distance[0]);
    const auto decide = [&](auto real) {
        using Real = decltype(real);
        const glm::vec<3, Real> from(eye);
        const std::span<const vdtree::Sphere> spheres = tree.support_spheres();
        return 1e9 / nodes * median_seconds(accuracy_repeats, [&] {
                   for (std::size_t node = 0; node < unfolds.size(); ++node) {
                       const Real radius = spheres[node].radius;
                       unfolds[node] = glm::distance(from, glm::vec<3, Real>(spheres[node].centre)) - radius <
                                       radius * static_cast<Real>(switch_distance);
                   }
               });
    };
    AccuracyPoints points = {{.name = "double", .values = {decide(double{}), 0}, .note = "a twin"}};
    const std::vector<std::uint8_t> truth = unfolds;
    const auto differing = [&](const auto& decided) {
        std::size_t count = 0;
        for (std::size_t node = 0; node < truth.size(); ++node) count += decided(node) != (truth[node] != 0);
        return static_cast<double>(count) / nodes;
    };
    const double in_float_ns = decide(float{});
    points.push_back({.name = "float",
                      .values = {in_float_ns, differing([&](std::size_t node) { return unfolds[node] != 0; })},
                      .note = "a twin"});
    std::vector<std::uint64_t> bits;
    const double seconds = median_seconds(
        accuracy_repeats, [&] { bits = require(vdtree::test_every_node(tree, criterion, {.eye = eye})); });
    points.push_back({.name = "the program's, float",
                      .values = {1e9 / nodes * seconds, differing([&](std::size_t node) {
                                     return ((bits[node / 64] >> (node % 64)) & 1) != 0;
                                 })},
                      .note = "with all that other criteria need",
                      .is_default = true});
    return points;
}

AccuracyPoints tree_points(AccuracySubject& subject) {
    const vdtree::Mesh mesh = whole_mesh(subject.session.tree());
    constexpr std::size_t one_in = 10; // triangles that stay
    const auto wanted = static_cast<vdtree::Index>(std::max<std::size_t>(mesh.triangles.size() / one_in, 4));
    AccuracyPoints points;
    for (const auto& [kind, name] :
         {std::pair<vdtree::ClustererKind, std::string>{vdtree::ClustererKind::quadric, "quadric"},
          {vdtree::ClustererKind::octree, "octree"}}) {
        vdtree::BuildOptions how;
        how.clusterer = kind;
        const auto start = BenchClock::now();
        const vdtree::VertexTree tree = tree_like(subject.session.tree(), mesh, how);
        double seconds = seconds_since(start);
        const auto extent = require(vdtree::extent_criterion(tree, subject.view, 1));
        vdtree::Cut cut(tree);
        vdtree::FollowOptions follow;
        follow.triangle_budget = wanted;
        require(cut.follow(extent, {.eye = vdtree::eye_in_tree(tree, subject.view, {})}, follow));
        const session::Session session = session_of(tree, subject);
        auto judge = require(session::PictureJudge::create(subject.context, session, subject.view, accuracy_samples));
        const double v = require(judge.judge(std::span(&cut, 1))).v;
        const double distance = millionths * mean_surface_distance(mesh, vdtree::extract_mesh(cut)),
                     bytes = static_cast<double>(tree.byte_size()) / tree.triangle_count(),
                     frame_us = follow_us(tree, extent, subject.view);
        const auto add = [&](const std::string& threads, const std::string& note) {
            points.push_back({.name = name + threads, .values = {seconds, distance, v, bytes, frame_us}, .note = note});
        };
        add(", all cores", grouped(cut.triangle_count()) + " triangles, by extent");
        points.back().is_default = kind == vdtree::BuildOptions().clusterer;
        for (how.threads = 1; how.threads <= 2; ++how.threads) {
            seconds = seconds_of([&] { static_cast<void>(tree_like(subject.session.tree(), mesh, how)); });
            add(how.threads == 1 ? ", one thread" : ", two threads", "the same tree");
        }
        if (kind == vdtree::ClustererKind::quadric && has_meshoptimizer())
            points.push_back(peer_point(subject, mesh, cut.triangle_count(), judge));
    }
    return points;
}

} // namespace unseen::app
