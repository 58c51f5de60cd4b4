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

} // namespace

Result<AccuracyPoints> cut_points(AccuracySubject& subject, const AccuracyBenchOptions& options) {
    session::Session& session = subject.session;
    const session::Request imperceptible = picture_request();
    session::Request budget = imperceptible;
    const auto first = session.simplify(subject.view, imperceptible);
    if (!first) return first.error();
    budget.goal = session::Goal::budget(std::max<vdtree::Index>(first->stats.triangles / 2, 1));
    AccuracyPoints points;
    const auto view_of = [&](int frame) {
        return vdtree::orbited(subject.view, cut_degrees_a_frame * std::max(frame - settling_frames, 0));
    };
    const int frames = settling_frames + options.repeats;
    const auto add = [&](const std::string& name, const session::Request& request, bool is_from_scratch,
                         bool is_default) -> Result<void> {
        const Pinned pinned;
        session::Request exact = request;
        exact.hysteresis = 1;
        exact.milliseconds.reset();
        session::Follower follower(session);
        std::vector<double> times;
        double error = 0;
        for (int i = is_from_scratch ? settling_frames : 0; i <= frames; ++i) {
            const vdtree::View now = view_of(i);
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
        points.push_back({.name = name, .values = {median(std::move(times)), error}, .is_default = is_default});
        return {};
    };
    if (auto ok = add("imperceptible, from scratch", imperceptible, true, false); !ok) return ok.error();
    if (auto ok = add("imperceptible, followed", imperceptible, false, true); !ok) return ok.error();
    for (const double milliseconds : {0.05, 0.2, 1.0}) {
        session::Request limited = imperceptible;
        limited.milliseconds = milliseconds;
        if (auto ok = add("imperceptible, followed, " + shortest(milliseconds) + " ms at most", limited, false, false);
            !ok)
            return ok.error();
    }
    if (session.scene().objects.size() > 1) {
        std::uint64_t triangles = 0;
        for (const int threads : {1, 2}) {
            ThreadedCuts cuts(session, threads);
            std::vector<double> times;
            for (int i = settling_frames; i <= frames; ++i) {
                const auto us = cuts.follow(view_of(i));
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
        subject.left_out.push_back("budgets with hysteresis, for it has several objects.");
        return points;
    }
    for (const double hysteresis : {1.0, 1.02, 1.1, 1.5, 2.0}) {
        session::Request within = budget;
        within.hysteresis = static_cast<float>(hysteresis);
        const bool is_default = within.hysteresis == session::Request().hysteresis;
        const std::string name = hysteresis == 1 ? "budget, exact" : "budget, hysteresis " + shortest(hysteresis);
        if (auto ok = add(name, within, false, is_default); !ok) return ok.error();
    }
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
    // The twin: what <unseen/vdtree/distance_criterion.h> says, in double from the tree's floats on.
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

Result<AccuracyPoints> tree_points(AccuracySubject& subject, const AccuracyBenchOptions& options) {
    const vdtree::VertexTree& own = subject.session.tree();
    vdtree::Cut full(own);
    full.unfold_all();
    const vdtree::Mesh mesh = vdtree::extract_mesh(full);
    constexpr std::size_t one_in = 10; // triangles that stay
    const auto wanted = static_cast<vdtree::Index>(std::max<std::size_t>(mesh.triangles.size() / one_in, 4));
    AccuracyPoints points;
    const auto session_of = [&](const vdtree::VertexTree& tree) {
        return session::Session::create(session::Scene::of(tree.share()), subject.session.observer());
    };
    const auto build_with = [&](const vdtree::BuildOptions& how, double& seconds) {
        const auto start = BenchClock::now();
        auto tree = vdtree::build_tree(mesh.view(), how);
        seconds = seconds_since(start);
        return tree;
    };
    constexpr double millionths = 1e6;
    for (const auto& [kind, name] :
         {std::pair{vdtree::ClustererKind::quadric, "quadric"}, {vdtree::ClustererKind::octree, "octree"}}) {
        vdtree::BuildOptions how;
        how.clusterer = kind;
        how.light = own.light();
        how.prelit = own.is_prelit();
        double seconds = 0;
        const auto tree = build_with(how, seconds);
        if (!tree) return tree.error();
        const auto extent = vdtree::extent_criterion(*tree, subject.view, 1);
        if (!extent) return extent.error();
        vdtree::Cut cut(*tree);
        vdtree::FollowOptions follow;
        follow.triangle_budget = wanted;
        if (auto made = cut.follow(*extent, {.eye = vdtree::eye_in_tree(*tree, subject.view, {})}, follow); !made)
            return made.error();
        auto session = session_of(*tree);
        if (!session) return session.error();
        auto pictures = session::PictureJudge::create(subject.context, *session, subject.view, options.samples);
        if (!pictures) return pictures.error();
        const auto verdict = pictures->judge(std::span(&cut, 1));
        if (!verdict) return verdict.error();
        const auto frame_us = follow_us(*tree, *extent, subject.view, options.repeats);
        if (!frame_us) return frame_us.error();
        const double distance = millionths * mean_surface_distance(mesh, vdtree::extract_mesh(cut));
        const double bytes = static_cast<double>(tree->byte_size()) / tree->triangle_count();
        points.push_back({.name = std::string(name) + ", all cores",
                          .values = {seconds, distance, verdict->v, bytes, *frame_us},
                          .note = grouped(cut.triangle_count()) + " triangles, by extent",
                          .is_default = kind == vdtree::BuildOptions().clusterer});
        for (const int threads : {1, 2}) {
            how.threads = threads;
            if (const auto again = build_with(how, seconds); !again) return again.error();
            points.push_back({.name = std::string(name) + (threads == 1 ? ", one thread" : ", two threads"),
                              .values = {seconds, distance, verdict->v, bytes, *frame_us},
                              .note = "the same tree"});
        }
        if (kind != vdtree::ClustererKind::quadric || !has_meshoptimizer()) continue;
        const auto start = BenchClock::now();
        const vdtree::Mesh simple = simplified_by_meshoptimizer(mesh, cut.triangle_count());
        seconds = seconds_since(start);
        how.threads = 0;
        const auto drawn = vdtree::build_tree(simple.view(), how);
        if (!drawn) return drawn.error();
        auto other = session_of(*drawn);
        if (!other) return other.error();
        auto renderer = session::SceneRenderer::create(subject.context, *other);
        if (!renderer) return renderer.error();
        const auto frame =
            renderer->draw(session::drawn_cuts(session::whole_cuts(*other)), subject.view, pictures->drawing());
        if (!frame) return frame.error();
        const auto seen = pictures->judge(*frame);
        if (!seen) return seen.error();
        points.push_back(
            {.name = "meshoptimizer",
             .values = {seconds, millionths * mean_surface_distance(mesh, simple), seen->v,
                        static_cast<double>(simple.triangles.size() * sizeof(vdtree::Triangle) +
                                            simple.positions.size() * (sizeof(glm::vec3) + sizeof(glm::vec3))) /
                            static_cast<double>(simple.triangles.size())},
             .note = grouped(simple.triangles.size()) + " triangles, one mesh for all views"});
    }
    return points;
}

} // namespace unseen::app
