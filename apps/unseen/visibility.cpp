#include "visibility.h"

#include <session_gpu/as_seen.h>

namespace unseen::app {

Result<session::Simplification> simplify_as_seen(session::Session& session, const vdtree::View& view,
                                                 const session::Request& request) {
    const auto context = render::Context::headless();
    if (!context) return context.error();
    return session::simplify_as_seen(session, *context, view, request);
}

} // namespace unseen::app
