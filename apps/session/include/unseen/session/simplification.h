// What a simplification came to.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <unseen/session/plan.h>
#include <unseen/vdtree/cut.h>

namespace unseen::session {

// Something that pictures are drawn for: whether it was called for, why, and what it took. What was not has no pass and
// no texture.
struct PassEffect {
    std::string name;
    bool on = false;
    Message why = {};
    int surface_passes = 0, full_screen_passes = 0; // drawings of the scene, a sample each; of planes
    std::uint64_t texture_bytes = 0;                // on the GPU, at most at a time
    double milliseconds = 0;                        // of wall-clock time
};

// Of all objects together.
struct Report {
    vdtree::Index source_triangles = 0;
    std::uint64_t dropped = 0;       // triangles that the meshes had and the trees have not: those with a vertex twice
    vdtree::AdjustStats stats;       // sums; the largest cost of all; complete where all are
    double adapt_ms = 0;             // making the cuts, in wall-clock time
    double extract_ms = 0;           // their index buffers
    double imperceptible_from_m = 0; // infinite: from nowhere; NaN: the fold test does not know
    std::vector<FoldTest> fold_tests = {}; // by object
    std::vector<Effect> effects = {};
    std::vector<PassEffect> passes = {}; // of simplify_as_seen() of <unseen/session_gpu/as_seen.h>
    // With geomorphs.
    std::optional<vdtree::Index> drawn_triangles = {}; // those that wait to be folded included
    std::size_t gliding = 0;                           // vertices that are on their way
};

struct Simplification : Report {
    std::vector<vdtree::Cut> cuts; // by object

    // The cut of an object as a mesh of its own, in that object's own frame, as its file had it. Cost: the cut's
    // triangles. Precondition: there is such an object.
    vdtree::Mesh mesh(std::size_t object = 0) const { return vdtree::extract_mesh(cuts[object]); }
};

} // namespace unseen::session
