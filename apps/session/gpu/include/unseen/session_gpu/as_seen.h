// Simplifications of pictures by what the pictures themselves show. Where session and render meet.
#pragma once

#include <unseen/render/context.h>
#include <unseen/session/session.h>

namespace unseen::session {

// What masks what folds change.
enum class Masking {
    none,
    // By band: no more than what the rest of the scene masks by itself, and than what the picture masks.
    scene,
};

struct AsSeenOptions {
    bool folds_hidden = true; // what lies behind what the picture shows
    Masking masking = Masking::none;
    int samples = 16; // N-rooks points a pixel, 1 to 256; what all of them miss is hidden
    int layers = 5;   // of depth, 1 to 16: objects are masked by what is in other layers than their own
};

// The simplification of a picture of this view, and of no other. The session's own simplification is drawn first, for
// what it shows. `request.purpose` counts as picture.
//
// What the view does not call for is not drawn: Report::passes says what was, why, and what it took. Nothing is masked
// where there is one object and nothing around it, for gazes that are not known for sure, and where everything moves over
// the retina; where the scene masks too little, no other fold test is made.
//
// It is the session's own simplification for the full model, by tests that count pixels, and under lights by other tests
// than `error`. Cost: two simplifications, so many drawings, with masking as many more for each layer, and the trees on
// the GPU meanwhile. Fails as Session::simplify() and drawing do.
Result<Simplification> simplify_as_seen(Session& session, const render::Context& context, const vdtree::View& view,
                                        Request request, const AsSeenOptions& options = {});

} // namespace unseen::session
