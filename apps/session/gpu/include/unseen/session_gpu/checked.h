// Simplifications that pictures have checked: what bounds of single folds cannot know, pictures of all of them can.
//
//     auto few = session::simplify_checked(*session, *context, view, {.goal = session::Goal::imperceptible()});
//     if (few->check->verified_views > 0) use(few->cuts);
#pragma once

#include <unseen/render/context.h>
#include <unseen/session/session.h>

namespace unseen::session {

// Error messages call these fields check.cell_degrees and so on.
struct CheckOptions {
    // How far the eye may go around the view's target, any way, at its distance: 0 to 10. 0: the picture of this view, and
    // the same with pixels that begin elsewhere.
    double cell_degrees = 0;
    double seconds = 120;   // after these no other cut is tried; above 0
    int samples = 64;       // a pixel of judged pictures, 1 to 256
    std::uint64_t seed = 1; // of the views that verify
    Progress progress = {}; // returning false stops: the last cut that passed is the result
};

// The fewest triangles in which neither judge of PictureJudge sees more than the goal's cost in thresholds; for
// Goal::imperceptible() nothing. One number is sought: the cost up to which folds are made, by request.order. A number of
// its own for each node would find still fewer, but then pixels and samples of the very pictures decide, and half a pixel
// beside them it shows. The cut is then verified in views that had no part in it, and where one fails, with a lower cost in
// other views. If nothing passes, the result is the full model.
//
// Hidden is what is hidden in all views by which the cost is sought. With a cell, `request.purpose` counts as mesh, without
// one as picture.
//
// Pictures have 16 samples where these are enough to tell, and else all. Cost: for each view a picture of the full model, and
// some ten pictures and judgements; some 100 bytes a pixel and view meanwhile. Fails for other goals than qualities, for
// orthographic views, for cells that reach into a solid, and where Session::simplify() and drawing do; with `cancelled` if it
// is stopped before anything has passed.
Result<Simplification> simplify_checked(Session& session, const render::Context& context, const vdtree::View& view,
                                        Request request, const CheckOptions& options = {});

// Random views in a cell, the same on all machines: the eye anywhere in it, and pixels that begin elsewhere by up to half.
std::vector<vdtree::View> views_in_cell(const vdtree::View& view, double cell_degrees, int count, std::uint64_t seed);

} // namespace unseen::session
