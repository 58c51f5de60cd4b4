// What accuracy costs: the perceptual test against the geometric ones, with and without gaze.
#include <cmath>
#include <optional>

#include <benchmark/benchmark.h>

#include <unseen/perception/criterion.h>
#include <unseen/perception/judge.h>
#include <unseen/vdtree/cut.h>

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

// A disc with fine detail on grey, and the same a little otherwise; 512 x 512 pixels.
perception::Image disc_with_detail(float more) {
    constexpr int side = 512;
    perception::Image image{side, side, 1, {}};
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x) {
            const float r = std::hypot(static_cast<float>(x - side / 2), static_cast<float>(y - side / 2)) / (side / 2);
            const float wave = std::sin(0.3f * static_cast<float>(x)) * std::sin(0.2f * static_cast<float>(y));
            image.values.push_back(r > 0.9f ? 20 : (90 - 70 * r) * (1 + (0.3f + more) * wave));
        }
    return image;
}

perception::JudgeOptions judge_options(bool gazes, bool is_second) {
    const auto gaze = gazes ? std::optional(glm::dvec2(1100, 256)) : std::nullopt;
    return is_second ? perception::second_judge_options(perception::default_person, {}, gaze)
                     : perception::JudgeOptions{.gaze_px = gaze};
}

void judge_prepare(benchmark::State& state) {
    const perception::Image reference = disc_with_detail(0);
    const perception::JudgeOptions options = judge_options(state.range(0), state.range(1));
    for (auto _ : state) benchmark::DoNotOptimize(perception::Judge::create(reference, options));
}
BENCHMARK(judge_prepare)->ArgNames({"gaze", "second"})->ArgsProduct({{0, 1}, {0, 1}})->Unit(benchmark::kMillisecond);

void judge_picture(benchmark::State& state) {
    const auto judge = *perception::Judge::create(disc_with_detail(0), judge_options(state.range(0), state.range(1)));
    const perception::Image test = disc_with_detail(0.01f);
    for (auto _ : state) benchmark::DoNotOptimize(judge.judge(test));
}
BENCHMARK(judge_picture)->ArgNames({"gaze", "second"})->ArgsProduct({{0, 1}, {0, 1}})->Unit(benchmark::kMillisecond);

} // namespace
} // namespace unseen::bench
