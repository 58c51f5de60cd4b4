// What a folded node gets wrong: how far its surface strays from the mesh's, and its luminance.
#pragma once

#include <cstdint>
#include <vector>

#include <vdtree/vertex_tree.h>

namespace unseen::vdtree {

// By how much the mean luminance of an area shifts where all nodes like one are folded: that of an area 2^k times as wide as the node
// by at most amount / 2^(k fading / 2), for k from 1 up to `octaves`, where the whole mesh is reached.
struct Drift {
    float amount = 0; // relative luminance, 0..1
    std::uint8_t fading = 0;  // 0: as large over any area, systematic; 2: as random errors do; 3: errors that cancel each other
    std::uint8_t octaves = 0;
    bool operator==(const Drift&) const = default;
};

// By interior node. The mesh's own surface in the node's support is compared with the ring of triangles around the proxy while the
// neighbours are folded as far as nodes that are no larger than this one and not much richer in luminance: about the cut in which nodes
// fold in the order of what they cost. Points compared: the children's proxies, leaves spread over the support, the leaves that were
// worst in the children, and the middles of the edges that the fold moves, before it with the surface after it and the other way.
//
// A measurement, not a bound over all cuts: neighbours may be finer (then the ring is, too) or coarser than assumed, and the worst
// point may lie between those compared.
struct FoldErrors {
    // The largest found, no less than the children's, and the mean over the points that were not chosen for their errors.
    std::vector<float> distance, mean_distance;   // mesh units: to the nearest point of the other surface
    std::vector<float> luminance, mean_luminance; // relative, 0..1: the difference to that point
    // Mesh units: half the mean distance of the ring's other corners from the proxy. What a fold changes is largest at the vertex and fades
    // to nothing at these, so it is about as wide as this, in a radius, also where the support is small in a ring of long triangles.
    // No less than the children's.
    std::vector<float> extent;
    // Of all triangles that touch the support, before and after the fold, with unfolded and with folded neighbours: where all of
    // these face the eye, or none does, the fold moves no outline. It includes the children's.
    std::vector<NormalSlabs> facing;
    std::vector<Drift> drift;
    float drift_luminance = 0; // relative, 0..1: the mesh's mean, to which all drift is related
};

// Under the tree's light. Cost: some 20 us a node; in parallel. Results do not depend on the threads. `threads`: 0: all cores.
FoldErrors measure_fold_errors(const VertexTree& tree, int threads = 0);

} // namespace unseen::vdtree
