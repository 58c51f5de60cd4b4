// What a folded node gets wrong: how far its surface strays from the mesh's, and its luminance.
#pragma once

#include <cstdint>

#include <vdtree/normal_mask.h>
#include <vdtree/result.h>

namespace unseen::vdtree {

class VertexTree;

// Of an interior node: what shows where it is folded instead of the mesh's own surface, while its neighbours are folded as far as nodes that are no larger
// than this one and not much richer in luminance, about the cut in which nodes fold in the order of what they cost; and while none is.
// Compared are small pictures of both surfaces, seen along the node's normal; and points: the children's proxies, leaves spread over the
// support, the leaves that were worst in the children, and three points of the edges that the fold moves, before it with the surface after
// it and the other way.
//
// A measurement, not a bound over all cuts: neighbours may be folded in other ways, and the pictures' cells and the points are few.
struct FoldError {
    // By how far an outline moves: the largest difference of the surfaces' heights, in the mean over a seventh of the width; where one part
    // of the surface is under another, the largest distance of a point from the other surface. No less than the children's. And the mean
    // distance of points. Mesh units.
    float distance = 0, mean_distance = 0;
    // Relative, 0..1: what bands of spatial frequency see, as the amplitude of a grating. A band sees no more than of a patch as wide as the node
    // of the amplitude `wide`, side by side with others like it of random signs, and of parts 2^-k as wide of 4^k times that, up to the
    // largest amplitude.
    float luminance = 0, wide_luminance = 0;
    // Mesh units: half the mean distance of the ring's other corners from the proxy. What a fold changes is largest at the vertex and fades
    // to nothing at these, so it is about as wide as this, in a radius, also where the support is small in a ring of long triangles.
    // No less than the children's.
    float extent = 0;
    // By how much the mean luminance of an area shifts, as a share of it, where all nodes like this one are folded: that of an area
    // 2^k times as wide as the node by at most drift / 2^(k fading / 2), for any k from 1 up to the whole mesh.
    float drift = 0;
    // Of all triangles that touch the support, before and after the fold, with unfolded and with folded neighbours: where all of
    // these face the eye, or none does, the fold moves no outline. It includes the children's.
    NormalSlabs facing;
    std::uint8_t fading = 0; // 0: as large over any area, systematic; 2: as random errors do; 3: errors that cancel each other
    std::uint8_t stage = 0;  // in which it folds: see fold_stages.h; no earlier than the children

    bool operator==(const FoldError&) const = default;
};
static_assert(sizeof(FoldError) == 40);

// The tree with the errors of its folds, under its light and with its luminances as they are, as
// VertexTree::fold_errors() and fold_stages(). Everything else is the given tree's. Folds err less with proxies whose
// luminances conserve the light: see conserve_light(), to be called before. Fails where check() does, and on trees with
// a texture, of which nothing is measured. Cost: some 50 us a node, and a second; in parallel. The result does not
// depend on the threads. `threads`: 0: all cores.
Result<VertexTree> with_fold_errors(const VertexTree& tree, int threads = 0);

} // namespace unseen::vdtree
