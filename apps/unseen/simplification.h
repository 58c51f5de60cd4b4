// From a scene and a wish to a cut, with its statistics and the effects that ran.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <perception/criterion.h>
#include <vdtree/cut.h>
#include <vdtree/cut_rings.h>
#include <vdtree/fold_errors.h>
#include <vdtree/geomorph.h>
#include <vdtree/occluders.h>

#include "report.h"
#include "scene.h"

namespace unseen::app {

// Something that may or may not have taken part, and the reason in a sentence.
struct Effect {
    std::string name;
    bool on = false;
    std::string why;
};

struct Simplification {
    vdtree::Index source_triangles = 0;
    std::uint64_t dropped = 0;
    vdtree::AdjustStats stats;
    double adapt_ms = 0;             // making the cut
    double extract_ms = 0;           // its index buffer
    double imperceptible_from_m = 0; // infinite: from nowhere; NaN: the fold test does not know
    std::optional<vdtree::Index> drawn_triangles; // with geomorphs: those that are still drawn, too
    std::size_t gliding = 0;                      // vertices
    std::vector<Effect> effects;
};

// What the picture is for decides what may be left out of it.
enum class Purpose {
    picture, // seen from this view only: what is out of the window is folded
    mesh,    // may be looked at from elsewhere
};

// Adjusts `cut`, which must be of the scene's tree. Cost: about a microsecond for each node test.
Result<Simplification> simplify(vdtree::Cut& cut, const Scene& scene, const WhatOptions& what, Purpose purpose);

// What folding costs by interior node, as simplify() goes by it. Not in the mode full.
Result<std::vector<float>> fold_costs(const Scene& scene, const WhatOptions& what, Purpose purpose);

// The default fold test goes by errors, which do not know textures, moving lights or colours: there, and where a very large tree does not hold
// them, another is taken, and its effect says why. Measures the errors of the tree's folds where they are needed and not there. Fails where a
// test that was asked for does not know the scene.
Result<void> settle_fold_test(Scene& scene, WhatOptions& what);

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

    // What follow() looks at: the criterion of `what`, valid until the next call, and where from. Not in the mode full.
    Result<const vdtree::DistanceCriterion*> criterion_for(const Scene& scene, const WhatOptions& what);
    vdtree::Viewpoint viewpoint_for(const Scene& scene, const WhatOptions& what, Purpose purpose);

private:
    // What a criterion depends on, besides the tree, its light and the display.
    struct Key {
        FoldTest test = FoldTest::luebke_hallen;
        double pixels = 0;
        bool has_gaze = false;
        double farthest_gaze_px = 0;
        int width = 0, height = 0;
        double fov_y_degrees = 0;
        perception::SceneLuminance scene = {0, 0};
        bool is_lit = false;
        const perception::CsfTable* csf = nullptr;
        bool chroma = false;
        bool operator==(const Key&) const = default;
    };
    Result<Simplification> change(vdtree::Cut& cut, const Scene& scene, const WhatOptions& what, Purpose purpose);
    Result<void> glide(const vdtree::Cut& cut, Simplification& result);

    double threshold_ = 1;
    float hysteresis_ = 1.1f;
    Key key_;
    std::optional<vdtree::DistanceCriterion> criterion_;
    std::optional<vdtree::CutRings> rings_;    // likewise
    std::optional<std::vector<vdtree::Sphere>> inner_spheres_; // likewise
    std::optional<vdtree::Geomorph> geomorph_;
    double passed_ = 0; // seconds since its last step
};

// The keys that simplify and render report; draw_ms is NaN where nothing was drawn.
Json to_json(const Simplification& simplification, double draw_ms);
void print(const Simplification& simplification, double draw_ms);

} // namespace unseen::app
