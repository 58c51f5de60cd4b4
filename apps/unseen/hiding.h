// Simplifying by what pictures hide and mask, for verbs that draw none.
#pragma once

#include <optional>

#include <unseen/session/session.h>

#include "options.h"

namespace unseen::render {
class Context;
}

namespace unseen::app {

// By session::simplify_as_seen() if the options ask for pictures, by default in a context of its own; fails then in
// builds without OpenGL. Else by the session's own simplification.
Result<session::Simplification> simplify_by(const WhatOptions& what, session::Session& session,
                                            const vdtree::View& view, const session::Request& request,
                                            const render::Context* context = nullptr);

} // namespace unseen::app
