// What accuracy costs: the perceptual test against the geometric ones, with and without gaze.
#include <benchmark/benchmark.h>

#include <perception/criterion.h>
#include <perception/judge.h>
#include <vdtree/criteria.h>
#include <vdtree/cut.h>

#include "bench_mesh.h"

namespace unseen::bench {
namespace {

std::vector<vdtree::NodeId> all_nodes() {
    std::vector<vdtree::NodeId> nodes(tree().interior_count());
    for (vdtree::NodeId n = 0; n < nodes.size(); ++n) nodes[n] = n;
    return nodes;
}

void time_tests(benchmark::State& state, const vdtree::FoldCriterion& criterion) {
    const std::vector<vdtree::NodeId> nodes = all_nodes();
    std::vector<float> costs(nodes.size());
    for (auto _ : state) {
        criterion(tree(), nodes, costs);
        benchmark::DoNotOptimize(costs.data());
    }
    state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(nodes.size()));
}

void test_extent(benchmark::State& state) { time_tests(state, vdtree::ExtentCriterion(tree(), orbit(0), 1)); }
void test_displacement(benchmark::State& state) {
    time_tests(state, vdtree::DisplacementCriterion(tree(), orbit(0), 1));
}
void test_luebke_hallen(benchmark::State& state) {
    perception::FoldTestOptions options;
    if (state.range(0)) options.gaze_px = glm::dvec2(1603, 512);
    time_tests(state, perception::LuebkeHallenCriterion(tree(), orbit(0), options));
}
BENCHMARK(test_extent);
BENCHMARK(test_displacement);
BENCHMARK(test_luebke_hallen)->ArgName("gaze")->Arg(0)->Arg(1);

void adjust_luebke_hallen(benchmark::State& state) {
    vdtree::Cut cut(tree());
    perception::FoldTestOptions options;
    if (state.range(0)) options.gaze_px = glm::dvec2(1603, 512);
    double degrees = 0;
    for (auto _ : state) {
        degrees += 1;
        cut.adjust(perception::LuebkeHallenCriterion(tree(), orbit(degrees), options));
        benchmark::DoNotOptimize(cut.indices().data());
    }
    state.counters["triangles"] = cut.triangle_count();
}
BENCHMARK(adjust_luebke_hallen)->ArgName("gaze")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

void csf_table_from_model(benchmark::State& state) {
    for (auto _ : state) benchmark::DoNotOptimize(perception::CsfTable::from_model(perception::CsfModel::castle));
}
BENCHMARK(csf_table_from_model)->Unit(benchmark::kMillisecond);

void judge_modern(benchmark::State& state) {
    perception::Image image;
    image.width = image.height = 1024;
    image.values.assign(1024 * 1024, 20.0f);
    for (std::size_t i = 0; i < image.values.size(); i += 7) image.values[i] = 22.0f;
    perception::Image other = image;
    for (std::size_t i = 0; i < other.values.size(); i += 11) other.values[i] *= 1.001f;
    perception::JudgeOptions options;
    options.gaze_px = glm::dvec2(200, 300);
    for (auto _ : state) benchmark::DoNotOptimize(perception::judge_modern(image, other, options));
}
BENCHMARK(judge_modern)->Unit(benchmark::kMillisecond);

} // namespace
} // namespace unseen::bench
