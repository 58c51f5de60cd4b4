// Simplifications of pictures by what the pictures themselves show. Where session and render meet.
#pragma once

#include <render/context.h>
#include <session/session.h>

namespace unseen::session {

// The simplification of a picture of this view, and of no other. What lies behind what it shows is folded, too. The
// session's own simplification is drawn first, for its depths. `request.purpose` counts as picture. `samples`: N-rooks
// points a pixel, 1 to 256; what all of them miss is hidden.
//
// It is the session's own simplification for the full model, by tests that count pixels, and under lights by other tests
// than `error`. Cost: two simplifications, so many drawings, and the trees on the GPU meanwhile. Fails as
// Session::simplify() and drawing do.
Result<Simplification> simplify_as_seen(Session& session, const render::Context& context, const vdtree::View& view,
                                        Request request, int samples = 16);

} // namespace unseen::session
