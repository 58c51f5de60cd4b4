#include "on_gpu.h"

#include <optional>

#include <unseen/render/context.h>
#include <unseen/session_gpu/as_seen.h>
#include <unseen/session_gpu/checked.h>
#include <unseen/session_gpu/gpu_judge.h>

#include "interruption.h"
#include "progress_bar.h"
#include "terminal.h"

namespace unseen::app {

namespace {

Result<session::Simplification> checked(const WhatOptions& what, session::Session& session, const vdtree::View& view,
                                        const session::Request& request, const render::Context& context) {
    const Interruptible until_interrupted;
    ProgressBar bar("checking");
    session::CheckOptions options{.cell_degrees = what.check_cell, .seconds = what.check_seconds};
    options.progress = [&](double share, const char* stage) {
        return bar(share, stage) && !until_interrupted.is_interrupted();
    };
    return session::simplify_checked(session, context, view, request, options);
}

} // namespace

Result<session::Simplification> simplify_by(const WhatOptions& what, session::Session& session,
                                            const vdtree::View& view, const session::Request& request,
                                            const render::Context* context) {
    const bool is_summed = session::goes_by_sum(request) && request.purpose == session::Purpose::picture &&
                           !view.orthographic_height && view.eye_distance == 0;
    const bool is_by_picture = what.hiding == Hiding::picture || is_summed || what.is_checked;
    const bool is_by_sides = !is_by_picture && view.eye_distance == 0 && session::goes_by_sum(request) &&
                             !request.milliseconds && request.goal.kind == session::Goal::Kind::budget;
    if (!is_by_picture && !is_by_sides) return session.simplify(view, request);
    std::optional<render::Context> own;
    if (!context) {
        auto made = render::Context::headless();
        if (!made && is_by_sides) {
            print_note("The budget goes by the largest cost and not by the sum of errors. " + made.error().message);
            return session.simplify(view, request);
        }
        if (!made) return made.error();
        context = &own.emplace(std::move(*made));
    }
    if (what.is_checked) return checked(what, session, view, request, *context);
    if (is_by_sides) return session::simplify_from_all_sides(session, *context, view, request);
    return session::simplify_as_seen(session, *context, view, request);
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
