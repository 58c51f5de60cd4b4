// What a simplification does and why: the plan before it is made, and the report and the cuts afterwards.
#pragma once

#include <unseen/session/request.h>
#include <unseen/vdtree/cut.h>

namespace unseen::session {

// Something that may or may not take part in a cut, or a rendering pass for it, and the reason in a sentence.
struct Effect {
    std::string name;
    bool on = false;
    Message why = {};
    // Only for passes, and only if they ran:
    int surface_passes = 0;          // drawings of the scene, with one sample each
    std::uint64_t texture_bytes = 0; // on the GPU, the most at a time
    double milliseconds = 0;         // wall-clock time
    std::size_t object = 0;          // of the scene
};

// For one object. The default fold test is `error`, if the tree has the errors of its folds or they may be measured.
// Otherwise it is luebke-hallen-safe, and also where `error` cannot see everything: with colours that count, textures
// over vertices of several hues under lights, shadows of lights that move, and, but in a single picture, lights that go with
// the camera and highlights. For goals in pixels it is `extent`.
struct Plan {
    FoldTest fold_test = FoldTest::error;
    std::string why = {};  // why this test and not `error`; empty if it is `error` or was asked for
    bool measures = false; // the errors of the tree's folds are still to be measured
    std::vector<Effect> effects = {};
};

// What pictures say of a simplification, see simplify_checked() in <unseen/session_gpu/checked.h>.
struct CheckFacts {
    double cost = 0;            // up to which folds were made
    double most_v = 1;          // thresholds: what is allowed, by either judge
    double cell_degrees = 0;    // how far the eye may go around what it looks at
    int fitted_views = 0;       // by which the cost was found
    int verified_views = 0;     // that had no part in it; 0: there was no time for them
    double v = 0, second_v = 0; // the largest difference in these, by both judges, in thresholds
    int looks = 0;              // pictures judged
    int rounds = 1;             // of verifying: others failed, and the cost was lowered
    double seconds = 0;         // wall-clock time
    bool is_settled = true;     // false: the time was over, or it was stopped, before the fewest triangles were found
};

// For all objects together.
struct Report {
    vdtree::Index source_triangles = 0;
    std::uint64_t dropped = 0;             // triangles of the meshes that the trees lack: those that use a vertex twice
    vdtree::AdjustStats stats;             // sums; the largest cost of all objects; complete if all are
    double adapt_ms = 0;                   // wall-clock time for the cuts
    double extract_ms = 0;                 // for their index buffers
    double imperceptible_from_m = 0;       // infinite: from nowhere; NaN: the fold test does not tell
    std::vector<FoldTest> fold_tests = {}; // by object
    std::vector<Effect> effects = {};
    std::vector<Effect> passes = {}; // of simplify_as_seen() in <unseen/session_gpu/as_seen.h>
    std::optional<CheckFacts> check = {};
    // With geomorphs:
    std::optional<vdtree::Index> drawn_triangles = {}; // with those that wait to be folded
    std::size_t gliding = 0;                           // vertices on their way
};

struct Simplification : Report {
    std::vector<vdtree::Cut> cuts; // by object

    // The cut of an object as a mesh, in the object's own frame as its file has it. Cost: the cut's triangles.
    // Precondition: the object exists.
    vdtree::Mesh mesh(std::size_t object = 0) const { return vdtree::extract_mesh(cuts[object]); }
};

} // namespace unseen::session
