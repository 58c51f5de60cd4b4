// What a folded node gets wrong: how far its surface strays from the mesh's, and its luminance.
#pragma once

#include <vector>

#include <vdtree/vertex_tree.h>

namespace unseen::vdtree {

// By interior node, each at least as large as its children's. The mesh's own surface in the node's support is compared with the
// ring of triangles around the proxy while the neighbours are folded as far as nodes that are no larger than this one: the
// cut in which nodes fold in the order of their size. Points compared: the children's proxies, leaves spread over the support,
// the leaves that were worst in the children, and the centres of the triangles that vanish here.
//
// A measurement, not a bound over all cuts: neighbours may be finer (then the ring is, too) or coarser than assumed, and the worst
// point may lie between those compared.
struct FoldErrors {
    std::vector<float> distance;  // mesh units: to the nearest point of the ring
    std::vector<float> luminance; // relative, 0..1: the difference to that point
    // Relative, 0..1: by how much the mean luminance of the ring's area shifts against the mesh's, with unfolded neighbours.
    std::vector<float> mean;
};

// Under the tree's light. Cost: about 2 us a node; in parallel. Results do not depend on the threads. `threads`: 0: all cores.
FoldErrors measure_fold_errors(const VertexTree& tree, int threads = 0);

} // namespace unseen::vdtree
