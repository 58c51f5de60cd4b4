// The judge on the GPU, beside perception_benchmark.cpp's judge_prepare and judge_picture: of pictures that are there
// already, until the sums are back. Wall clock, since software rendering has no clock of its own.
#include <cmath>
#include <optional>

#include <benchmark/benchmark.h>

#include <unseen/session_gpu/gpu_judge.h>

namespace unseen::bench {
namespace {

using render::VisibilityPrecision;
using session::GpuJudge;

// Fine detail on grey, and the same a little otherwise.
std::vector<float> detail(int side, float more) {
    std::vector<float> values;
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x)
            values.push_back(40 * (1 + (0.3f + more) * std::sin(0.3f * static_cast<float>(x)) *
                                           std::sin(0.2f * static_cast<float>(y))));
    return values;
}

struct Pictures {
    std::optional<render::Context> context;
    std::optional<render::LuminanceImage> reference, test;
    perception::JudgeOptions options;
    VisibilityPrecision precision = VisibilityPrecision::full;

    // False, and the benchmark is left out, where there is no OpenGL.
    bool make(benchmark::State& state) {
        auto made = render::Context::headless();
        if (!made) return state.SkipWithError(made.error().message.c_str()), false;
        context = *made;
        const auto side = static_cast<int>(state.range(0));
        reference = std::move(*render::LuminanceImage::create(*context, side, side, detail(side, 0)));
        test = std::move(*render::LuminanceImage::create(*context, side, side, detail(side, 0.01f)));
        if (state.range(1)) options.gaze_px = glm::dvec2(side + 600, side / 2);
        if (state.range(2)) precision = VisibilityPrecision::half;
        state.SetLabel(context->renderer_name());
        return true;
    }
};

void gpu_judge_prepare(benchmark::State& state) {
    Pictures p;
    if (!p.make(state)) return;
    for (auto _ : state) {
        benchmark::DoNotOptimize(GpuJudge::create(*p.context, p.reference->texture(), p.options, p.precision));
        benchmark::DoNotOptimize(p.context->finish());
    }
}

void gpu_judge_picture(benchmark::State& state) {
    Pictures p;
    if (!p.make(state)) return;
    auto made = GpuJudge::create(*p.context, p.reference->texture(), p.options, p.precision);
    if (!made) return state.SkipWithError(made.error().message.c_str());
    GpuJudge& judge = *made;
    benchmark::DoNotOptimize(judge.judge(p.test->texture())); // which compiles the programs
    for (auto _ : state) benchmark::DoNotOptimize(judge.judge(p.test->texture()));
}

void shapes(benchmark::internal::Benchmark* b) {
    b->ArgNames({"side", "gaze", "half"})->ArgsProduct({{512, 1024}, {0, 1}, {0, 1}});
    b->Unit(benchmark::kMillisecond)->UseRealTime();
}
BENCHMARK(gpu_judge_prepare)->Apply(shapes);
BENCHMARK(gpu_judge_picture)->Apply(shapes);

} // namespace
} // namespace unseen::bench
