// Simplifications for pictures that also use what the picture itself shows.
#pragma once

#include <unseen/render/context.h>
#include <unseen/session/session.h>

namespace unseen::session {

struct AsSeenOptions {
    bool folds_hidden = true; // fold everything that lies behind what the picture shows
    int samples = 16;         // N-rooks points a pixel, 1 to 256; nodes that none of them shows are hidden
};

// A simplification for a picture of this very view. First the session's own simplification is drawn, to see what it
// shows. `request.purpose` counts as picture. Report::passes says what was drawn, why, and what it cost.
//
// For the full model, for pixel tests, and under lights for tests other than `error`, the result is the session's own
// simplification. Cost: two simplifications, `samples` drawings, and the trees on the GPU meanwhile. Fails where
// Session::simplify() and drawing do.
Result<Simplification> simplify_as_seen(Session& session, const render::Context& context, const vdtree::View& view,
                                        Request request, const AsSeenOptions& options = {});

// A budget of meshes that are looked at from all around: errors add up by what 14 pictures show of each part, drawn from
// directions evenly around the scene. `request.purpose` counts as mesh. What no picture shows is held by the fold test alone.
//
// The session's own simplification for other requests than budgets by the sum, for orthographic views, and for eyes inside
// of the scene's sphere. Cost: 14 drawings, and as many searches for what they show, of a microsecond a triangle. Fails where
// Session::simplify() and drawing do.
Result<Simplification> simplify_from_all_sides(Session& session, const render::Context& context,
                                               const vdtree::View& view, Request request);

} // namespace unseen::session
