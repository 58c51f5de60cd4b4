// How cuts are kept, and what they are cuts of.
#include "accuracy_axes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <thread>
#include <utility>

#include <glm/geometric.hpp>

#include <unseen/session_gpu/picture_judge.h>
#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/cut.h>

#include "bench_tools.h"
#include "peer_simplify.h"
#include "surface_distance.h"
#include "terminal.h"

namespace unseen::app {
namespace {

constexpr double cut_degrees_a_frame = 0.1;
constexpr int settling_frames = 16; // of the first view: what is limited in time comes to rest in them

session::Request picture_request() {
    session::Request request{.purpose = session::Purpose::picture};
    request.reasons = false;
    return request;
}

// A cut an object, object by object, by recipes of the session: as one thread keeps them, or several.
class ThreadedCuts {
public:
    ThreadedCuts(session::Session& session, int threads) : session_(session), threads_(threads) {
        for (std::size_t i = 0; i < session.scene().objects.size(); ++i) cuts_.emplace_back(session.tree(i));
    }

    // Microseconds, without the recipes.
    Result<double> follow(const vdtree::View& view) {
        std::vector<session::CutRecipe> recipes;
        for (std::size_t i = 0; i < cuts_.size(); ++i) {
            auto recipe = session_.recipe(view, picture_request(), i);
            if (!recipe) return recipe.error();
            recipes.push_back(std::move(*recipe));
        }
        std::vector<std::uint8_t> failed(static_cast<std::size_t>(threads_));
        const auto work = [&](int thread) {
            for (auto i = static_cast<std::size_t>(thread); i < cuts_.size(); i += static_cast<std::size_t>(threads_))
                if (!cuts_[i].follow(*recipes[i].criterion, recipes[i].viewpoint, recipes[i].options))
                    failed[static_cast<std::size_t>(thread)] = 1;
        };
        const auto start = BenchClock::now();
        std::vector<std::thread> others;
        for (int t = 1; t < threads_; ++t) others.emplace_back(work, t);
        work(0);
        for (std::thread& other : others) other.join();
        const double us = 1e6 * seconds_since(start);
        if (std::ranges::find(failed, 1) != failed.end())
            return Error{ErrorCode::invalid_argument, "A cut could not be followed."};
        return us;
    }
    std::uint64_t triangles() const {
        std::uint64_t sum = 0;
        for (const vdtree::Cut& cut : cuts_) sum += cut.triangle_count();
        return sum;
    }

private:
    session::Session& session_;
    int threads_;
    std::vector<vdtree::Cut> cuts_;
};

// Microseconds a frame: a cut that follows an eye around a tree, and its indices.
Result<double> follow_us(const vdtree::VertexTree& tree, const vdtree::DistanceCriterion& criterion,
                         const vdtree::View& view, int frames) {
    const Pinned pinned;
    constexpr int settling = 2; // the first makes the cut, the second what to watch
    vdtree::Cut cut(tree);
    std::vector<double> times;
    for (int i = 0; i < settling + frames; ++i) {
        const vdtree::View now = vdtree::orbited(view, cut_degrees_a_frame * i);
        const auto start = BenchClock::now();
        const auto followed = cut.follow(criterion, {.eye = vdtree::eye_in_tree(tree, now, {})});
        if (!followed) return followed.error();
        static_cast<void>(cut.indices());
        if (i >= settling) times.push_back(1e6 * seconds_since(start));
    }
    return median(std::move(times));
}

// Frames of an eye that stands still for a while, and then goes around.
struct CutFrames {
    const vdtree::View& first;
    int count;

    vdtree::View view(int frame) const {
        return vdtree::orbited(first, cut_degrees_a_frame * std::max(frame - settling_frames, 0));
    }
};

// The time of a frame, and how far its triangles are from those of an exact cut from scratch.
Result<AccuracyPoint> kept_point(session::Session& session, const CutFrames& frames, const std::string& name,
                                 const session::Request& request, bool is_from_scratch) {
    const Pinned pinned;
    session::Request exact = request;
    exact.hysteresis = 1;
    exact.milliseconds.reset();
    session::Follower follower(session);
    std::vector<double> times;
    double error = 0;
    for (int i = is_from_scratch ? settling_frames : 0; i <= frames.count; ++i) {
        const vdtree::View now = frames.view(i);
        const auto start = BenchClock::now();
        double triangles = 0;
        if (is_from_scratch) {
            const auto made = session.simplify(now, request);
            if (!made) return made.error();
            triangles = made->stats.triangles;
        } else {
            const auto made = follower.follow(now, request);
            if (!made) return made.error();
            triangles = made->stats.triangles;
        }
        if (i <= settling_frames) continue;
        times.push_back(1e6 * seconds_since(start));
        const auto truth = session.simplify(now, exact);
        if (!truth) return truth.error();
        error = std::max(error, std::abs(triangles / std::max<double>(1, truth->stats.triangles) - 1));
    }
    return AccuracyPoint{.name = name, .values = {median(std::move(times)), error}};
}

// What threads make of several objects, without the session around them.
Result<void> add_threads(session::Session& session, const CutFrames& frames, AccuracyPoints& points) {
    std::uint64_t triangles = 0;
    for (const int threads : {1, 2}) {
        ThreadedCuts cuts(session, threads);
        std::vector<double> times;
        for (int i = settling_frames; i <= frames.count; ++i) {
            const auto us = cuts.follow(frames.view(i));
            if (!us) return us.error();
            if (i > settling_frames) times.push_back(*us);
        }
        if (threads == 1) triangles = cuts.triangles();
        const double off = std::abs(static_cast<double>(cuts.triangles()) / static_cast<double>(triangles) - 1);
        points.push_back(
            {.name = threads == 1 ? "cuts alone, one thread" : "cuts alone, two threads",
             .values = {median(std::move(times)), off},
             .note = threads == 1 ? "object by object, without what the session does around them" : "a twin"});
    }
    return {};
}

} // namespace

Result<AccuracyPoints> cut_points(AccuracySubject& subject, const AccuracyBenchOptions& options) {
    struct Kept {
        std::string name;
        session::Request request;
        bool is_from_scratch = false;
    };
    session::Session& session = subject.session;
    const bool is_one = session.scene().objects.size() == 1;
    const session::Request imperceptible = picture_request();
    const auto first = session.simplify(subject.view, imperceptible);
    if (!first) return first.error();
    std::vector<Kept> all = {{"imperceptible, from scratch", imperceptible, true},
                             {"imperceptible, followed", imperceptible}};
    for (const double milliseconds : {0.05, 0.2, 1.0}) {
        all.push_back({"imperceptible, followed, " + shortest(milliseconds) + " ms at most", imperceptible});
        all.back().request.milliseconds = milliseconds;
    }
    for (const double hysteresis : {1.0, 1.02, 1.1, 1.5, 2.0}) {
        if (!is_one) break;
        all.push_back(
            {hysteresis == 1 ? "budget, exact" : "budget, hysteresis " + shortest(hysteresis), imperceptible});
        all.back().request.goal = session::Goal::budget(std::max<vdtree::Index>(first->stats.triangles / 2, 1));
        all.back().request.hysteresis = static_cast<float>(hysteresis);
    }
    const CutFrames frames{subject.view, settling_frames + options.repeats};
    AccuracyPoints points;
    for (const Kept& kept : all) {
        auto point = kept_point(session, frames, kept.name, kept.request, kept.is_from_scratch);
        if (!point) return point.error();
        point->is_default =
            kept.name == "imperceptible, followed" || (kept.request.goal.kind == session::Goal::Kind::budget &&
                                                       kept.request.hysteresis == session::Request().hysteresis);
        points.push_back(std::move(*point));
    }
    if (is_one) return points;
    if (auto added = add_threads(session, frames, points); !added) return added.error();
    subject.left_out.push_back("budgets with hysteresis, for it has several objects.");
    return points;
}

Result<AccuracyPoints> node_test_points(AccuracySubject& subject, const AccuracyBenchOptions& options) {
    const vdtree::VertexTree& tree = subject.session.tree();
    constexpr double tolerance_px = 1;
    const auto criterion = vdtree::extent_criterion(tree, subject.view, tolerance_px);
    if (!criterion) return criterion.error();
    const vdtree::Similarity& placement = subject.session.scene().objects[0].placement;
    const glm::dvec3 eye = vdtree::eye_in_tree(tree, subject.view, placement);
    const double nodes = static_cast<double>(tree.interior_count());
    const Pinned pinned;
    // The twin: what <unseen/vdtree/criteria.h> says, in double from the tree's floats on.
    std::vector<std::uint8_t> unfolds(tree.interior_count());
    const double switch_distance = static_cast<double>(criterion->parts().switch_distance[0]);
    const auto decide = [&](auto real) {
        using Real = decltype(real);
        const glm::vec<3, Real> from(eye);
        const std::span<const vdtree::Sphere> spheres = tree.support_spheres();
        std::vector<double> times;
        for (int repeat = 0; repeat < options.repeats; ++repeat) {
            const auto start = BenchClock::now();
            for (std::size_t node = 0; node < unfolds.size(); ++node) {
                const Real radius = spheres[node].radius;
                unfolds[node] = glm::distance(from, glm::vec<3, Real>(spheres[node].centre)) - radius <
                                radius * static_cast<Real>(switch_distance);
            }
            times.push_back(1e9 * seconds_since(start) / nodes);
        }
        return median(std::move(times));
    };
    AccuracyPoints points;
    const double in_double_ns = decide(double{});
    const std::vector<std::uint8_t> truth = unfolds;
    points.push_back({.name = "double", .values = {in_double_ns, 0}, .note = "a twin"});
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
    std::vector<double> times;
    for (int repeat = 0; repeat < options.repeats; ++repeat) {
        const auto start = BenchClock::now();
        auto tested = vdtree::test_every_node(tree, *criterion, {.eye = eye});
        if (!tested) return tested.error();
        times.push_back(1e9 * seconds_since(start) / nodes);
        bits = std::move(*tested);
    }
    points.push_back({.name = "the program's, float",
                      .values = {median(std::move(times)), differing([&](std::size_t node) {
                                     return ((bits[node / 64] >> (node % 64)) & 1) != 0;
                                 })},
                      .note = "with all that other criteria need",
                      .is_default = true});
    return points;
}

namespace {

constexpr double millionths = 1e6;

vdtree::BuildOptions as_built(const vdtree::VertexTree& tree, vdtree::ClustererKind kind) {
    vdtree::BuildOptions how;
    how.clusterer = kind;
    how.light = tree.light();
    how.prelit = tree.is_prelit();
    return how;
}

Result<session::Session> session_of(const vdtree::VertexTree& tree, const AccuracySubject& subject) {
    return session::Session::create(session::Scene::of(tree.share()), subject.session.observer());
}

Result<AccuracyPoint> peer_point(const AccuracySubject& subject, const vdtree::Mesh& mesh, vdtree::Index wanted,
                                 const session::PictureJudge& judge) {
    const auto start = BenchClock::now();
    const vdtree::Mesh simple = simplified_by_meshoptimizer(mesh, wanted);
    const double seconds = seconds_since(start);
    const auto tree =
        vdtree::build_tree(simple.view(), as_built(subject.session.tree(), vdtree::ClustererKind::quadric));
    if (!tree) return tree.error();
    const auto session = session_of(*tree, subject);
    if (!session) return session.error();
    auto renderer = session::SceneRenderer::create(subject.context, *session);
    if (!renderer) return renderer.error();
    const auto frame =
        renderer->draw(session::drawn_cuts(session::whole_cuts(*session)), subject.view, judge.drawing());
    if (!frame) return frame.error();
    const auto seen = judge.judge(*frame);
    if (!seen) return seen.error();
    const auto triangles = static_cast<double>(simple.triangles.size());
    constexpr double of_vertex = 2 * sizeof(glm::vec3);
    return AccuracyPoint{
        .name = "meshoptimizer",
        .values = {seconds, millionths * mean_surface_distance(mesh, simple), seen->v,
                   sizeof(vdtree::Triangle) + of_vertex * static_cast<double>(simple.positions.size()) / triangles},
        .note = grouped(simple.triangles.size()) + " triangles, one mesh for all views"};
}

} // namespace

Result<AccuracyPoints> tree_points(AccuracySubject& subject, const AccuracyBenchOptions& options) {
    const vdtree::Mesh mesh = whole_mesh(subject.session.tree());
    constexpr std::size_t one_in = 10; // triangles that stay
    const auto wanted = static_cast<vdtree::Index>(std::max<std::size_t>(mesh.triangles.size() / one_in, 4));
    AccuracyPoints points;
    for (const auto& [kind, name] :
         {std::pair{vdtree::ClustererKind::quadric, "quadric"}, {vdtree::ClustererKind::octree, "octree"}}) {
        vdtree::BuildOptions how = as_built(subject.session.tree(), kind);
        auto start = BenchClock::now();
        const auto tree = vdtree::build_tree(mesh.view(), how);
        double seconds = seconds_since(start);
        if (!tree) return tree.error();
        const auto extent = vdtree::extent_criterion(*tree, subject.view, 1);
        if (!extent) return extent.error();
        vdtree::Cut cut(*tree);
        vdtree::FollowOptions follow;
        follow.triangle_budget = wanted;
        if (auto made = cut.follow(*extent, {.eye = vdtree::eye_in_tree(*tree, subject.view, {})}, follow); !made)
            return made.error();
        auto session = session_of(*tree, subject);
        if (!session) return session.error();
        auto judge = session::PictureJudge::create(subject.context, *session, subject.view, options.samples);
        if (!judge) return judge.error();
        const auto verdict = judge->judge(std::span(&cut, 1));
        if (!verdict) return verdict.error();
        const auto frame_us = follow_us(*tree, *extent, subject.view, options.repeats);
        if (!frame_us) return frame_us.error();
        const double distance = millionths * mean_surface_distance(mesh, vdtree::extract_mesh(cut));
        const double bytes = static_cast<double>(tree->byte_size()) / tree->triangle_count();
        points.push_back({.name = std::string(name) + ", all cores",
                          .values = {seconds, distance, verdict->v, bytes, *frame_us},
                          .note = grouped(cut.triangle_count()) + " triangles, by extent",
                          .is_default = kind == vdtree::BuildOptions().clusterer});
        for (how.threads = 1; how.threads <= 2; ++how.threads) {
            start = BenchClock::now();
            if (const auto again = vdtree::build_tree(mesh.view(), how); !again) return again.error();
            seconds = seconds_since(start);
            points.push_back({.name = std::string(name) + (how.threads == 1 ? ", one thread" : ", two threads"),
                              .values = {seconds, distance, verdict->v, bytes, *frame_us},
                              .note = "the same tree"});
        }
        if (kind != vdtree::ClustererKind::quadric || !has_meshoptimizer()) continue;
        auto peer = peer_point(subject, mesh, cut.triangle_count(), *judge);
        if (!peer) return peer.error();
        points.push_back(std::move(*peer));
    }
    return points;
}

} // namespace unseen::app
