// Cuts that follow a view, by the perceptual test with silhouettes and by the default one: what one frame takes with
// its index buffer, and what it goes with. `unseen-bench engine` prints the same against what is promised.
#include <benchmark/benchmark.h>

#include <cmath>
#include <limits>

#include <unseen/perception/criterion.h>
#include <unseen/perception/fold_measurement.h>
#include <unseen/vdtree/cut.h>

#include "bench_mesh.h"
#include "followed_frames.h"

namespace unseen::bench {
namespace {

using vdtree::Cut;

struct Subject {
    Subject(const vdtree::VertexTree& tree_, bool gazes, bool by_errors = false, bool frustum = false)
        : tree(tree_), options(fold_test(gazes)), with_frustum(frustum), criterion(make(by_errors)) {
        if (gazes) return; // as it comes out at threshold 1
        threshold = threshold_of_much(tree, [&](Cut& cut, float at) { return follow(cut, 0, at); });
    }

    vdtree::AdjustStats follow(Cut& cut, double degrees) const { return follow(cut, degrees, threshold); }
    vdtree::AdjustStats follow(Cut& cut, double degrees, float at) const {
        vdtree::FollowOptions following;
        following.threshold = at;
        return follow(cut, degrees, following);
    }
    vdtree::AdjustStats follow(Cut& cut, double degrees, const vdtree::FollowOptions& following) const {
        return *cut.follow(criterion, perception::viewpoint_of(tree, orbit(tree, degrees), options, {}, with_frustum),
                           following);
    }

    const vdtree::VertexTree& tree;
    perception::FoldTestOptions options;
    bool with_frustum;
    vdtree::DistanceCriterion criterion;
    float threshold = 1;

private:
    static perception::FoldTestOptions fold_test(bool gazes) {
        perception::FoldTestOptions test;
        if (gazes) test.gaze_px = glm::dvec2(1603, 512); // 29 degrees aside
        return test;
    }
    vdtree::DistanceCriterion make(bool by_errors) const {
        return by_errors ? *perception::error_distances(tree, orbit(tree, 0), options)
                         : *perception::luebke_hallen_distances(tree, orbit(tree, 0), options);
    }
};

const Subject& subject(bool gazes, bool large) {
    static const Subject foveal(tree(), false), aside(tree(), true);
    if (!large) return gazes ? aside : foveal;
    static const Subject foveal_large(large_tree(), false);
    return foveal_large;
}

const vdtree::VertexTree& tree_with_errors() {
    static const vdtree::VertexTree measured = *perception::measure_folds(tree());
    return measured;
}

void follow_orbit_of(benchmark::State& state, const Subject& s) {
    follow_turns(state, s.tree, 5, [&](Cut& cut, double degrees) { return s.follow(cut, degrees); });
}
void follow_orbit(benchmark::State& state, bool gazes, bool large) { follow_orbit_of(state, subject(gazes, large)); }
BENCHMARK_CAPTURE(follow_orbit, foveal, false, false)
    ->ArgName("tenth_degrees")
    ->Arg(1)
    ->Arg(10)
    ->Arg(50)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(follow_orbit, gaze, true, false)
    ->ArgName("tenth_degrees")
    ->Arg(1)
    ->Arg(10)
    ->Arg(50)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(follow_orbit, foveal_of_16_times_the_mesh, false, true)
    ->ArgName("tenth_degrees")
    ->Arg(1)
    ->Arg(10)
    ->Arg(50)
    ->Unit(benchmark::kMicrosecond);

// All of the model is in the window.
void follow_orbit_in_frustum(benchmark::State& state) {
    static const Subject in_frustum(tree(), false, false, true);
    follow_orbit_of(state, in_frustum);
}
BENCHMARK(follow_orbit_in_frustum)->ArgName("tenth_degrees")->Arg(1)->Arg(10)->Arg(50)->Unit(benchmark::kMicrosecond);

void follow_orbit_by_errors(benchmark::State& state, bool with_frustum) {
    static const Subject without(tree_with_errors(), false, true, false), with(tree_with_errors(), false, true, true);
    follow_orbit_of(state, with_frustum ? with : without);
}
BENCHMARK_CAPTURE(follow_orbit_by_errors, without_frustum, false)
    ->ArgName("tenth_degrees")
    ->Arg(1)
    ->Arg(10)
    ->Arg(50)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(follow_orbit_by_errors, with_frustum, true)
    ->ArgName("tenth_degrees")
    ->Arg(1)
    ->Arg(10)
    ->Arg(50)
    ->Unit(benchmark::kMicrosecond);

void follow_still(benchmark::State& state) {
    const Subject& s = subject(false, false);
    const vdtree::Viewpoint viewpoint = perception::viewpoint_of(s.tree, orbit(s.tree, 0), s.options, {}, false);
    vdtree::FollowOptions following;
    following.threshold = s.threshold;
    Cut cut(s.tree);
    for (auto _ : state) {
        benchmark::DoNotOptimize(cut.follow(s.criterion, viewpoint, following));
        benchmark::DoNotOptimize(cut.indices().data());
    }
}
BENCHMARK(follow_still)->Unit(benchmark::kNanosecond);

void follow_teleport(benchmark::State& state, bool large) {
    const Subject& s = subject(false, large);
    Cut cut(s.tree);
    int jump = 0;
    for (auto _ : state) {
        ++jump;
        s.follow(cut, 180 * jump + jump % 3);
        benchmark::DoNotOptimize(cut.indices().data());
    }
}
BENCHMARK_CAPTURE(follow_teleport, mesh, false)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(follow_teleport, 16_times_the_mesh, true)->Unit(benchmark::kMillisecond);

// Every node of the tree, results only.
void tests_from_scratch(benchmark::State& state) {
    const Subject& s = subject(false, false);
    const vdtree::Viewpoint viewpoint = perception::viewpoint_of(s.tree, orbit(s.tree, 0), s.options, {}, false);
    vdtree::FollowOptions following;
    following.threshold = s.threshold;
    std::uint64_t tests = 0;
    for (auto _ : state) {
        benchmark::DoNotOptimize(vdtree::test_every_node(s.tree, s.criterion, viewpoint, following));
        tests += s.tree.interior_count();
    }
    state.counters["tests/s"] = benchmark::Counter(static_cast<double>(tests), benchmark::Counter::kIsRate);
}
BENCHMARK(tests_from_scratch)->Unit(benchmark::kMillisecond);

// Cold: a new cut each time. Else an orbit of one degree a frame, with the best cut always, or with one that is stable.
void budget(benchmark::State& state, bool cold, float hysteresis) {
    const Subject& s = subject(false, false);
    Cut cut(s.tree);
    vdtree::FollowOptions following;
    following.triangle_budget = static_cast<vdtree::Index>(much_of(s.tree));
    following.hysteresis = hysteresis;
    double degrees = 0;
    for (auto _ : state) {
        if (cold) cut = Cut(s.tree);
        s.follow(cut, degrees += 1, following);
        benchmark::DoNotOptimize(cut.indices().data());
    }
    state.counters["triangles"] = cut.triangle_count();
}
BENCHMARK_CAPTURE(budget, cold, true, 1.0f)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(budget, best_at_1_degree, false, 1.0f)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(budget, stable_at_1_degree, false, 1.1f)->Unit(benchmark::kMillisecond);

void resident_bytes(benchmark::State& state) {
    const Subject& s = subject(false, false);
    Cut cut(s.tree);
    double degrees = 0;
    for (auto _ : state) {
        s.follow(cut, degrees += 0.1);
        benchmark::DoNotOptimize(cut.indices().data());
    }
    const double triangles = s.tree.triangle_count();
    state.counters["bytes/triangle"] = static_cast<double>(s.tree.byte_size()) / triangles;
    state.counters["with_cut"] = static_cast<double>(s.tree.byte_size() + cut.byte_size()) / triangles;
}
BENCHMARK(resident_bytes)->Iterations(10);

} // namespace
} // namespace unseen::bench
