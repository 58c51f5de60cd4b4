// Building, adjusting and gathering; rates are per input triangle, per node test and per active triangle.
#include <cmath>

#include <benchmark/benchmark.h>
#include <glm/geometric.hpp>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/cut.h>

#include "bench_mesh.h"

namespace unseen::bench {
namespace {

using vdtree::ClustererKind;
using vdtree::Cut;
using vdtree::NodeId;
using vdtree::Sphere;
using vdtree::VertexTree;
using vdtree::View;

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

// Node extent in pixels, as a callback of a caller's own.
class ExtentCosts {
public:
    ExtentCosts(const View& view, double tolerance_pixels)
        : eye_(vdtree::eye_in_tree(tree(), view, {})), scale_(vdtree::pixels_per_radian(view) / tolerance_pixels) {}
    void operator()(const VertexTree& of, std::span<const NodeId> nodes, std::span<float> costs) const {
        for (std::size_t i = 0; i < nodes.size(); ++i) {
            const Sphere& s = of.support_spheres()[nodes[i]];
            const double distance = glm::length(glm::dvec3(s.centre) - eye_);
            costs[i] = distance > s.radius ? static_cast<float>(2 * std::asin(s.radius / distance) * scale_)
                                           : vdtree::unbounded_cost(0);
        }
    }

private:
    glm::dvec3 eye_;
    double scale_;
};

// An orbit of so many tenths of a degree a frame, by node extent of four pixels.
void adjust_orbit(benchmark::State& state) {
    Cut cut(tree());
    double degrees = 0;
    std::uint64_t tests = 0;
    for (auto _ : state) {
        degrees += static_cast<double>(state.range(0)) / 10;
        tests += cut.adjust(ExtentCosts(orbit(degrees), 4)).node_tests;
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
        cut.adjust(ExtentCosts(orbit(degrees), 1), options);
    }
}
BENCHMARK(adjust_budget)->Unit(benchmark::kMicrosecond);

void gather(benchmark::State& state) {
    Cut cut(tree());
    std::uint64_t triangles = 0;
    for (auto _ : state) {
        state.PauseTiming();
        cut.fold_all();
        cut.adjust(ExtentCosts(orbit(0), 4));
        state.ResumeTiming();
        benchmark::DoNotOptimize(cut.indices().data());
        triangles += cut.triangle_count();
    }
    state.counters["triangles/s"] = benchmark::Counter(static_cast<double>(triangles), benchmark::Counter::kIsRate);
}
BENCHMARK(gather)->Unit(benchmark::kMicrosecond);

} // namespace
} // namespace unseen::bench
