// Simplifications of pictures by what the pictures themselves show. Where session and render meet.
#pragma once

#include <render/context.h>
#include <session/session.h>

namespace unseen::session {

// The simplification of a picture of this view, and of no other: what lies behind what it shows is folded, too, which
// costs no pixel. The session's own simplification is drawn first, for its depths. A picture that is moved by a pixel
// shows nothing else. `request.purpose` counts as picture. `samples`: N-rooks points a pixel, 1 to 256; what all of them
// miss is hidden. Cost: two simplifications, so many drawings, and the trees on the GPU meanwhile. Where lights are
// and the test is not `error`, for the full model and by tests that count pixels it is the session's own simplification. Fails as
// Session::simplify() and drawing do.
Result<Simplification> simplify_as_seen(Session& session, const render::Context& context, const vdtree::View& view,
                                        Request request, int samples = 16);

} // namespace unseen::session
