// What pictures hide, for verbs that draw none.
#pragma once

#include <session/session.h>

namespace unseen::app {

// session::simplify_as_seen(), in a context of its own. In builds without OpenGL it fails.
Result<session::Simplification> simplify_as_seen(session::Session& session, const vdtree::View& view,
                                                 const session::Request& request);

} // namespace unseen::app
