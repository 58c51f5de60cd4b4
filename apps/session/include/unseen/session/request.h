// What is wanted of a simplification.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <unseen/perception/masking.h>
#include <unseen/vdtree/depth_picture.h>
#include <unseen/vdtree/mesh.h>
#include <unseen/vdtree/result.h>

namespace unseen::session {

// See perception/criterion.h for the first three, and vdtree/criteria.h for the others.
enum class FoldTest { luebke_hallen, luebke_hallen_safe, error, extent, displacement };

// By contrast sensitivity; the others count pixels, seen or not.
constexpr bool is_perceptual(FoldTest test) { return test != FoldTest::extent && test != FoldTest::displacement; }
std::string name_of(FoldTest test); // "luebke-hallen", ...

// How far to fold.
struct Goal {
    enum class Kind { imperceptible, full, budget, pixels };

    Kind kind = Kind::imperceptible;
    vdtree::Index triangles = 0; // of budgets: at most so many, of all objects together; 1 or more
    bool fill = false;           // of budgets: use all of them, even where no difference can be seen
    double tolerance_px = 0;     // of pixels: above 0 and finite

    static Goal imperceptible() { return {}; }          // fold what nobody can see
    static Goal full() { return {.kind = Kind::full}; } // fold nothing
    // As inconspicuous as so many triangles can be.
    static Goal budget(vdtree::Index triangles, bool fill = false) {
        return {.kind = Kind::budget, .triangles = triangles, .fill = fill};
    }
    // Fold what is smaller, seen or not.
    static Goal pixels(double tolerance) { return {.kind = Kind::pixels, .tolerance_px = tolerance}; }
};

// What the cut is for decides what may be left out of it.
enum class Purpose {
    mesh,    // may be looked at from elsewhere
    picture, // seen from this view only: what is out of the window, faces away or is hidden in a solid is folded
};

// Error messages and reasons call these fields request.goal, request.fold_test and so on.
struct Request {
    Goal goal = {};
    std::optional<FoldTest> fold_test = {};  // default: one that suits the scene and the goal, see Plan
    bool chroma = false;                     // changes of colour count, too, not only those of luminance
    std::optional<double> milliseconds = {}; // the best cut that so much time is enough for; 0 or more
    double threshold = 1;    // of imperceptible: fold up to this cost; 2: what cannot be seen from twice the distance
    float hysteresis = 1.1f; // of budgets, frame by frame: by what factor the largest cost may exceed the least, 1..2
    Purpose purpose = Purpose::mesh;
    // Of pictures: what this view, and no other, shows. What lies behind that is folded, too: simplify_as_seen() of
    // <unseen/session_gpu/as_seen.h> draws it. Under lights only by the test error.
    std::optional<vdtree::DepthPicture> shown = {};
    // Of pictures: what the scene of this view, and of no other, masks of each object; by object, or empty: nothing.
    // Counts for the test error, for gazes that are known for sure and where nothing moves over the retina.
    std::vector<perception::MaskingPicture> masking = {};
    // Keep outlines whose shadows would move visibly, where lights cast some. False: a cut for the eye alone, whose
    // shadows may show it.
    bool keeps_shadows = true;
    // Measure the errors of folds where the test needs them and the tree lacks them: up to a minute.
    bool may_measure = true;
    // Report::effects: some 20 us an object, which flights through scenes of many can do without.
    bool reasons = true;
};

// Whether the fields are in their ranges and go together, whatever the scene. The error names them.
Result<void> validate(const Request& request);

} // namespace unseen::session
