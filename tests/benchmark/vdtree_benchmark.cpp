// Building, adjusting and gathering; rates are per input triangle, per node test and per active triangle.
#include <benchmark/benchmark.h>

#include <vdtree/builder.h>
#include <vdtree/criteria.h>
#include <vdtree/cut.h>

#include "bench_mesh.h"

namespace unseen::bench {
namespace {

using vdtree::ClustererKind;
using vdtree::Cut;

void build(benchmark::State& state, ClustererKind clusterer, int threads) {
    vdtree::BuildOptions options;
    options.clusterer = clusterer;
    options.threads = threads;
    double bytes = 0;
    for (auto _ : state) {
        const auto tree = vdtree::build_tree(mesh().view(), options);
        bytes = static_cast<double>(tree->byte_size());
    }
    const auto triangles = static_cast<double>(mesh().triangles.size());
    state.counters["triangles/s"] =
        benchmark::Counter(triangles * static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
    state.counters["bytes/triangle"] = bytes / triangles;
}
BENCHMARK_CAPTURE(build, octree_1_thread, ClustererKind::octree, 1)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(build, quadric_1_thread, ClustererKind::quadric, 1)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(build, quadric_2_threads, ClustererKind::quadric, 2)->Unit(benchmark::kMillisecond);

// An orbit of so many tenths of a degree a frame, by node extent of one pixel.
void adjust_orbit(benchmark::State& state) {
    Cut cut(tree());
    double degrees = 0;
    std::uint64_t tests = 0;
    for (auto _ : state) {
        degrees += static_cast<double>(state.range(0)) / 10;
        tests += cut.adjust(vdtree::ExtentCriterion(tree(), orbit(degrees), 4)).node_tests;
    }
    state.counters["tests/s"] = benchmark::Counter(static_cast<double>(tests), benchmark::Counter::kIsRate);
    state.counters["triangles"] = cut.triangle_count();
}
BENCHMARK(adjust_orbit)->Arg(1)->Arg(10)->Arg(50)->Unit(benchmark::kMicrosecond);

void adjust_budget(benchmark::State& state) {
    Cut cut(tree());
    vdtree::AdjustOptions options;
    options.triangle_budget = static_cast<vdtree::Index>(mesh().triangles.size() / 10);
    double degrees = 0;
    for (auto _ : state) {
        degrees += 1;
        cut.adjust(vdtree::ExtentCriterion(tree(), orbit(degrees), 1), options);
    }
}
BENCHMARK(adjust_budget)->Unit(benchmark::kMicrosecond);

void gather(benchmark::State& state) {
    Cut cut(tree());
    std::uint64_t triangles = 0;
    for (auto _ : state) {
        state.PauseTiming();
        cut.fold_all();
        cut.adjust(vdtree::ExtentCriterion(tree(), orbit(0), 4));
        state.ResumeTiming();
        benchmark::DoNotOptimize(cut.indices().data());
        triangles += cut.triangle_count();
    }
    state.counters["triangles/s"] = benchmark::Counter(static_cast<double>(triangles), benchmark::Counter::kIsRate);
}
BENCHMARK(gather)->Unit(benchmark::kMicrosecond);

} // namespace
} // namespace unseen::bench
