// From a scene and a wish to a cut, with its statistics and the effects that ran.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <vdtree/cut.h>
#include <vdtree/distance_criterion.h>
#include <vdtree/geomorph.h>

#include "effects.h"
#include "fold_test.h"
#include "report.h"
#include "scene.h"

namespace unseen::app {

struct Simplification {
    vdtree::Index source_triangles = 0;
    std::uint64_t dropped = 0; // triangles of the mesh
    vdtree::AdjustStats stats;
    double adapt_ms = 0;             // making the cut
    double extract_ms = 0;           // its index buffer
    double imperceptible_from_m = 0; // infinite: from nowhere; NaN: the fold test does not know
    std::optional<vdtree::Index> drawn_triangles; // with geomorphs: those that are still drawn, too
    std::size_t gliding = 0;                      // vertices
    std::vector<Effect> effects;
};

// Adjusts `cut`, which must be of the scene's tree, by a settled fold test (see fold_test.h). Cost: about a microsecond for each node test.
Result<Simplification> simplify(vdtree::Cut& cut, const Scene& scene, const WhatOptions& what, Purpose purpose);

// Keeps a cut at what moving views of a scene ask for. In the modes imperceptible and pixels the cost goes with what changes from
// one call to the next; the others begin anew each time (full: once).
class Follower {
public:
    // Folds up to this cost are made: 2 lets go what could be seen, but not from twice the display's distance. Pixels count in
    // units of their tolerance.
    void set_threshold(double threshold) { threshold_ = threshold; } // precondition: positive and finite

    // Of triangle budgets: by what factor the largest fold cost may exceed the least, so that cuts keep still; 1: not at all.
    void set_hysteresis(float hysteresis) { hysteresis_ = hysteresis; }

    // From now on vertices glide for so long where the cut changes, and geomorph() is what to draw. Fails where that is no time.
    Result<void> set_geomorph(const Scene& scene, double seconds);
    void let_pass(double seconds) { passed_ += seconds; } // for the glides of the next call; precondition: not negative, finite
    const vdtree::Geomorph* geomorph() const { return geomorph_ ? &*geomorph_ : nullptr; }

    // Adjusts `cut`, which must be of the scene's tree and the same from call to call.
    Result<Simplification> follow(vdtree::Cut& cut, const Scene& scene, const WhatOptions& what,
                                  Purpose purpose = Purpose::picture);

private:
    Result<Simplification> change(vdtree::Cut& cut, const Scene& scene, const WhatOptions& what, Purpose purpose);
    vdtree::Viewpoint viewpoint_for(const Scene& scene, const WhatOptions& what, Purpose purpose) const;
    Result<void> glide(const vdtree::Cut& cut, Simplification& result);

    double threshold_ = 1;
    float hysteresis_ = 1.1f;
    std::shared_ptr<const vdtree::DistanceCriterion> criterion_; // of the last cut, which refers to it
    std::optional<vdtree::Geomorph> geomorph_;
    double passed_ = 0; // seconds since its last step
};

// The keys that simplify and render report; draw_ms is NaN where nothing was drawn.
Json to_json(const Simplification& simplification, double draw_ms);
void print(const Simplification& simplification, double draw_ms);

} // namespace unseen::app
