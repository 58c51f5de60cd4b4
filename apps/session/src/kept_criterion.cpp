#include "kept_criterion.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

namespace unseen::session {
namespace {

// The view without its place, which only viewpoints depend on; so do they on the height of an orthographic one.
vdtree::View lens_of(vdtree::View view) {
    const vdtree::View nowhere;
    view.eye = nowhere.eye, view.target = nowhere.target, view.up = nowhere.up;
    if (view.orthographic_height) view.orthographic_height = 1;
    return view;
}

// A gaze off the window reaches into larger magnifications: one criterion must do for all gazes up to there, so they
// are rounded up to whole windows.
double farthest_gaze_px(const vdtree::View& view, glm::dvec2 gaze_px) {
    const double side = std::max(view.width, view.height);
    return std::ceil(std::max(glm::length(gaze_px - vdtree::axis_px(view)) / side, 1.0)) * side;
}

// A budget goes by the order of the costs alone, for which any tolerance will do.
double tolerance_px(const Goal& goal) { return goal.kind == Goal::Kind::pixels ? goal.tolerance_px : 1; }

} // namespace

Key key_of(const Sight& sight, const Decision& decision) {
    Key key;
    key.test = decision.test;
    key.lens = lens_of(sight.view);
    if (!is_perceptual(decision.test)) {
        key.pixels = tolerance_px(decision.request.goal);
        return key;
    }
    key.scene = sight.luminance;
    key.is_lit = sight.lighting != nullptr;
    if (decision.test == FoldTest::error) key.still_lights = sight.lighting;
    key.chroma = decision.request.chroma;
    key.csf = sight.csf;
    if (sight.gaze_px) key.farthest_gaze_px = farthest_gaze_px(sight.view, *sight.gaze_px);
    return key;
}

perception::FoldTestOptions test_options(const Sight& sight, const Decision& decision, const Key& key) {
    perception::FoldTestOptions options = test_options(sight, decision.request);
    if (key.farthest_gaze_px) options.gaze_px = vdtree::axis_px(sight.view) + glm::dvec2(*key.farthest_gaze_px, 0);
    return options;
}

std::shared_ptr<const KeptCriterion>& last_criterion(Sight& sight, const Key& key) {
    return key.still_lights ? sight.lit_criterion : sight.cache.criterion;
}

} // namespace unseen::session
