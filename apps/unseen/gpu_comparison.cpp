#include "gpu_comparison.h"

#include <unseen/render/context.h>
#include <unseen/session_gpu/gpu_judge.h>

namespace unseen::app {

Result<GpuComparison> compare_on_gpu(const perception::Image& reference, const perception::Image& test,
                                     const perception::JudgeOptions& options, bool wants_threshold_map) {
    const auto context = render::Context::headless();
    if (!context) return context.error();
    auto judge = session::GpuJudge::create(*context, reference, options);
    if (!judge) return judge.error();
    auto judgement = judge->judge(test);
    if (!judgement) return judgement.error();
    GpuComparison comparison{std::move(*judgement), {}, context->renderer_name()};
    if (!wants_threshold_map) return comparison;
    auto map = judge->threshold_map();
    if (!map) return map.error();
    comparison.threshold_map = std::move(*map);
    return comparison;
}

} // namespace unseen::app
