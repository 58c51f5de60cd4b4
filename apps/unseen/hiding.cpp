#include "hiding.h"

#include <unseen/session_gpu/as_seen.h>

namespace unseen::app {

Result<session::Simplification> simplify_by(const WhatOptions& what, session::Session& session,
                                            const vdtree::View& view, const session::Request& request,
                                            const render::Context* context) {
    if (what.hiding == Hiding::spheres && !what.masks) return session.simplify(view, request);
    session::AsSeenOptions options;
    options.folds_hidden = what.hiding == Hiding::picture;
    options.masking = what.masks ? session::Masking::scene : session::Masking::none;
    if (context) return session::simplify_as_seen(session, *context, view, request, options);
    const auto own = render::Context::headless();
    if (!own) return own.error();
    return session::simplify_as_seen(session, *own, view, request, options);
}

} // namespace unseen::app
