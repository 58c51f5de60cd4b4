#include "on_gpu.h"

#include <unseen/render/context.h>
#include <unseen/session_gpu/as_seen.h>
#include <unseen/session_gpu/gpu_judge.h>

namespace unseen::app {

Result<session::Simplification> simplify_by(const WhatOptions& what, session::Session& session,
                                            const vdtree::View& view, const session::Request& request,
                                            const render::Context* context) {
    const bool is_summed =
        session::goes_by_sum(request) && request.purpose == session::Purpose::picture && !view.orthographic_height;
    if (what.hiding == Hiding::spheres && !what.masks && !is_summed) return session.simplify(view, request);
    session::AsSeenOptions options;
    options.folds_hidden = what.hiding == Hiding::picture || is_summed;
    options.masking = what.masks ? session::Masking::scene : session::Masking::none;
    if (context) return session::simplify_as_seen(session, *context, view, request, options);
    const auto own = render::Context::headless();
    if (!own) return own.error();
    return session::simplify_as_seen(session, *own, view, request, options);
}

Result<Verdict> compare_on_gpu(const perception::Image& reference, const perception::Image& test,
                               const perception::JudgeOptions& options) {
    const auto context = render::Context::headless();
    if (!context) return context.error();
    auto judge = session::GpuJudge::create(*context, reference, options);
    if (!judge) return judge.error();
    auto judgement = judge->judge(test);
    if (!judgement) return judgement.error();
    return Verdict{std::move(*judgement), context->renderer_name()};
}

} // namespace unseen::app
