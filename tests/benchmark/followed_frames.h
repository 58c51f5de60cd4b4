// What benchmarks of followed cuts share: a threshold that leaves much of the mesh active, and the frames that count.
#pragma once

#include <algorithm>
#include <cmath>

#include <benchmark/benchmark.h>

#include <unseen/vdtree/cut.h>

#include "bench_mesh.h"

namespace unseen::bench {

// Half of the mesh, or 100,000 triangles where it is larger.
inline double much_of(const vdtree::VertexTree& tree) { return std::min(1e5, 0.5 * tree.triangle_count()); }

// At which about that much is active. `follow(cut, threshold)`.
template <class Follow>
float threshold_of_much(const vdtree::VertexTree& tree, Follow&& follow) {
    const double wanted = much_of(tree);
    vdtree::Cut cut(tree);
    float threshold = 1;
    double low = -20, high = 20; // log2 of the threshold
    for (int step = 0; step < 20; ++step) {
        threshold = static_cast<float>(std::exp2((low + high) / 2));
        (follow(cut, threshold).triangles > wanted ? low : high) = std::log2(static_cast<double>(threshold));
    }
    return threshold;
}

// Frames with their index buffer, each turned by the benchmark's argument, tenths of a degree. `follow(cut, degrees)`.
template <class Follow>
void follow_turns(benchmark::State& state, const vdtree::VertexTree& tree, int warm_up, Follow&& follow) {
    vdtree::Cut cut(tree);
    double degrees = 0, changes = 0, tests = 0, triangles = 0;
    const double step = static_cast<double>(state.range(0)) / 10;
    const auto next = [&] {
        const vdtree::AdjustStats stats = follow(cut, degrees += step);
        benchmark::DoNotOptimize(cut.indices().data());
        changes += static_cast<double>(stats.folds + stats.unfolds);
        tests += static_cast<double>(stats.node_tests);
        triangles = stats.triangles;
    };
    for (int i = 0; i < warm_up; ++i) next();
    changes = tests = 0;
    for (auto _ : state) next();
    state.counters["changes"] = benchmark::Counter(changes, benchmark::Counter::kAvgIterations);
    state.counters["tests"] = benchmark::Counter(tests, benchmark::Counter::kAvgIterations);
    state.counters["triangles"] = triangles;
}

} // namespace unseen::bench
