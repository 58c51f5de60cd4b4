// What a simplification should achieve.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <unseen/vdtree/depth_picture.h>
#include <unseen/vdtree/mesh.h>
#include <unseen/vdtree/result.h>

namespace unseen::session {

// See perception/criterion.h for the first three, and vdtree/criteria.h for the others.
enum class FoldTest { luebke_hallen, luebke_hallen_safe, error, extent, displacement };

struct FoldTestFacts {
    FoldTest test = FoldTest::error;
    std::string_view name = {};    // "luebke-hallen"
    std::string_view title = {};   // for people: "measured errors"
    std::string_view summary = {}; // "perceptual: what folds change in fact"
    bool is_perceptual = false;    // by contrast sensitivity; the others count pixels, seen or not
    bool is_safe = false;          // every fold that can be seen costs more than 1, by the model
};
std::span<const FoldTestFacts> fold_tests() noexcept; // all, in the order in which to offer them
const FoldTestFacts& facts_of(FoldTest test) noexcept;
bool is_perceptual(FoldTest test) noexcept;
std::string name_of(FoldTest test);

// How much of a difference may be left, by name. Costs are fitted with ColorVideoVDP, for what one looks at; see
// docs/evidence.md, "Qualities".
enum class Quality { invisible, lossless, good, draft };

struct QualityFacts {
    Quality quality = Quality::invisible;
    std::string_view name = {};    // "lossless"
    std::string_view summary = {}; // "hardly anybody does who compares"
    // Folds up to this cost are made: by the fold test alone, and where errors also add up in a picture.
    double cost = 1, summed_cost = 1;
};
std::span<const QualityFacts> qualities() noexcept; // all, the best first
const QualityFacts& facts_of(Quality quality) noexcept;

// How far to fold.
struct Goal {
    enum class Kind { quality, full, budget, pixels };

    Kind kind = Kind::quality;
    // For qualities: folds up to this cost are made: above 0 and finite. Where errors also add up in a picture, up to the
    // second one; 0: nothing adds up.
    double cost = 1, summed_cost = 0;
    vdtree::Index triangles = 0; // for budgets: at most this many in all objects together; 1 or more
    bool fill = false;           // for budgets: use all of them, even where no difference can be seen
    double tolerance_px = 0;     // for pixels: above 0 and finite

    static Goal imperceptible() { return {}; }          // fold whatever nobody can see
    static Goal full() { return {.kind = Kind::full}; } // fold nothing
    // Fold what cannot be seen from this many times the distance.
    static Goal up_to(double cost) { return {.cost = cost}; }
    // The least conspicuous cut with this many triangles.
    static Goal budget(vdtree::Index triangles, bool fill = false) {
        return {.kind = Kind::budget, .triangles = triangles, .fill = fill};
    }
    // The fewest triangles that look so. Invisible: the same as imperceptible().
    static Goal quality(Quality quality) {
        if (quality == Quality::invisible) return imperceptible();
        return {.cost = facts_of(quality).cost, .summed_cost = facts_of(quality).summed_cost};
    }
    // Fold everything smaller, visible or not.
    static Goal pixels(double tolerance) { return {.kind = Kind::pixels, .tolerance_px = tolerance}; }
};

// What a budget, or a quality, makes least.
enum class Order {
    sum,     // the error that adds up in the picture, see perception::summed_costs(), as far as nothing sticks out
    largest, // the largest cost of a fold
};

// What the cut is for.
enum class Purpose {
    mesh,    // it may be looked at from anywhere
    picture, // it is seen from this view only: whatever is outside the window, faces away or is hidden in a solid folds
    // It is seen from this view only, and the next one follows: whatever is outside the window folds, and within budgets
    // what faces away. Folding more takes longer from view to view than drawing it.
    flight,
};

// Error messages and reasons call these fields request.goal, request.fold_test and so on.
struct Request {
    Goal goal = {};
    std::optional<FoldTest> fold_test = {};  // default: one that suits the scene and the goal, see Plan
    std::optional<double> milliseconds = {}; // time limit: the best cut found in it; 0 or more
    float hysteresis = 1.1f; // for budgets in followers: the largest cost may exceed the least by this factor, 1..2
    Purpose purpose = Purpose::mesh;
    // For budgets and qualities. The sum needs `shown`, of the mesh or a cut within a pixel of it, and the test `error`;
    // without them, as in followers, the largest cost counts.
    Order order = Order::sum;
    // Depths of the views that the cut is looked at from: whatever lies behind all of them folds, and for the sum what they
    // show of each part counts in the mean. For pictures one, of this very view; for meshes any, and with a budget nothing
    // folds for being hidden, so that the mesh may be looked at from elsewhere. <unseen/session_gpu/as_seen.h> draws them.
    // Under lights only the test `error` uses them.
    std::vector<vdtree::DepthPicture> shown = {};
    // Keep outlines whose shadows would move visibly. False: the cut is for the eye alone; its shadows may reveal it.
    bool keeps_shadows = true;
    // Measure the errors of folds if the test needs them and the tree lacks them, which takes up to a minute. False:
    // use errors only if they are there, as after Session::prepare(), and not under lights that move, for which a second
    // passes from time to time.
    bool may_measure = true;
    // Fill in Report::effects. Cost: some 20 us an object; turn it off for flights through scenes of many objects.
    bool reasons = true;
};

// The name of a goal's quality; null for other goals and other costs.
const QualityFacts* named_quality(const Goal& goal) noexcept;
// Whether a request is for a budget or a quality that goes by the sum of errors, if pictures show what there is.
bool goes_by_sum(const Request& request) noexcept;

// Checks that the fields are in their ranges and go together, whatever the scene. The error names the field.
Result<void> validate(const Request& request);

} // namespace unseen::session
