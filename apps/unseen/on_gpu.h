// What verbs that draw nothing do by pictures; a build without OpenGL says why it cannot.
#pragma once

#include <string>

#include <unseen/perception/judge.h>
#include <unseen/session/session.h>

#include "options.h"

namespace unseen::render {
class Context;
}

namespace unseen::app {

// By session::simplify_checked() or simplify_as_seen() if the options ask for pictures, budgets of meshes by
// simplify_from_all_sides(), by default in a context of its own. Else by the session's own simplification. A check that the
// user interrupts ends with the last cut that passed.
Result<session::Simplification> simplify_by(const WhatOptions& what, session::Session& session,
                                            const vdtree::View& view, const session::Request& request,
                                            const render::Context* context = nullptr);

struct Verdict {
    perception::Judgement judgement;
    std::string gpu; // which judged; empty: the CPU
};
Result<Verdict> compare_on_gpu(const perception::Image& reference, const perception::Image& test,
                               const perception::JudgeOptions& options);

} // namespace unseen::app
