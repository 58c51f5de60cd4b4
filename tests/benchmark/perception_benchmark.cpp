// What accuracy costs: the perceptual test against the geometric ones, with and without gaze.
#include <benchmark/benchmark.h>

#include <perception/criterion.h>
#include <perception/judge.h>
#include <vdtree/cut.h>

#include "bench_mesh.h"

namespace unseen::bench {
namespace {

perception::FoldTestOptions fold_test(bool gazes) {
    perception::FoldTestOptions options;
    if (gazes) options.gaze_px = glm::dvec2(1603, 512);
    return options;
}

vdtree::DistanceCriterion luebke_hallen(bool gazes) {
    return *perception::luebke_hallen_distances(tree(), orbit(0), fold_test(gazes));
}

void time_tests(benchmark::State& state, const vdtree::DistanceCriterion& criterion, bool gazes) {
    const vdtree::Viewpoint viewpoint = perception::viewpoint_of(tree(), orbit(0), fold_test(gazes), {}, false);
    for (auto _ : state) benchmark::DoNotOptimize(vdtree::test_every_node(tree(), criterion, viewpoint));
    state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(tree().interior_count()));
}

void test_extent(benchmark::State& state) { time_tests(state, *vdtree::extent_criterion(tree(), orbit(0), 1), false); }
void test_displacement(benchmark::State& state) {
    time_tests(state, *vdtree::displacement_criterion(tree(), orbit(0), 1), false);
}
void test_luebke_hallen(benchmark::State& state) { time_tests(state, luebke_hallen(state.range(0)), state.range(0)); }
BENCHMARK(test_extent);
BENCHMARK(test_displacement);
BENCHMARK(test_luebke_hallen)->ArgName("gaze")->Arg(0)->Arg(1);

void make_luebke_hallen(benchmark::State& state) {
    for (auto _ : state) benchmark::DoNotOptimize(luebke_hallen(state.range(0)));
}
BENCHMARK(make_luebke_hallen)->ArgName("gaze")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

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
