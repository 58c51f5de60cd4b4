// What a folded node gets wrong: how far its surface strays from the mesh's, and its luminance.
#pragma once

#include <vector>

#include <vdtree/vertex_tree.h>

namespace unseen::vdtree {

// By interior node, each at least as large as its children's. The mesh's own surface in the node's support is compared with the
// ring of triangles around the proxy while the neighbours are folded as far as nodes that are no larger than this one and not much
// richer in luminance: about the cut in which nodes fold in the order of what they cost. Points compared: the children's proxies,
// leaves spread over the support, the leaves that were worst in the children, and the middles of the edges that the fold moves, before
// it with the surface after it and the other way.
//
// A measurement, not a bound over all cuts: neighbours may be finer (then the ring is, too) or coarser than assumed, and the worst
// point may lie between those compared.
struct FoldErrors {
    std::vector<float> distance;  // mesh units: to the nearest point of the other surface
    std::vector<float> luminance; // relative, 0..1: the difference to that point
    // Mesh units: half the mean distance of the ring's other corners from the proxy. What a fold changes is largest at the vertex and fades
    // to nothing at these, so it is about as wide as this, in a radius, also where the support is small in a ring of long triangles.
    std::vector<float> extent;
    // Of all triangles that touch the support, before and after the fold, with unfolded and with folded neighbours: where all of
    // these face the eye, or none does, the fold moves no outline.
    std::vector<NormalSlabs> facing;
    // Relative, 0..1: by how much the mean luminance of the ring's area shifts against the mesh's, with unfolded neighbours.
    std::vector<float> shift;
    // Relative, 0..1: by how much the mean luminance of an area of some 32 nodes like this one shifts: what adds up, and does not
    // cancel.
    std::vector<float> mean;
};

// Under the tree's light. Cost: some 20 us a node; in parallel. Results do not depend on the threads. `threads`: 0: all cores.
FoldErrors measure_fold_errors(const VertexTree& tree, int threads = 0);

} // namespace unseen::vdtree
