// What the ring of a folded node can be in any cut, when its neighbours are folded, too.
#pragma once

#include <vector>

#include <vdtree/vertex_tree.h>

namespace unseen::vdtree {

// By interior node. Of two nodes the one with the larger support sphere is the larger; of equal ones, the one of the lower number.
//
// In every cut, each triangle drawn that is not one of the mesh's own has a largest node among its corners. All of the triangle's
// corners lie within `radius` of the centre of that node's ring sphere, and their luminances within its `luminance`: those are the
// corners of the mesh's triangles around the node's support, and the proxies of all nodes no larger that one of these
// corners can have been folded into. Both hold for the mesh's triangles there, too, and contain the node's ring. (Where all of a node's leaves
// lie at one point its luminance is the tree's ring_luminance(): nothing moves, and no more than that changes.)
struct CutRings {
    std::vector<PackedRange> luminance; // at least the children's
    std::vector<float> radius;          // mesh units; at least the children's

    // Relative luminance, 0..1: what the fold, with unfolded neighbours, adds to the light of the triangles around or takes from it, besides
    // what their area changes, over the area that belongs to the support: a third of each triangle for each corner. The areas of
    // different nodes do not overlap: where neighbours fold, their light changes by the mean of these, weighted by their areas, at most. At
    // least as large as the children's.
    std::vector<float> mean_shift;

    // The same of the colours, as they are drawn; empty where the tree's ring_chroma() is.
    std::vector<ChromaRange> chroma;
    std::vector<glm::vec2> mean_chroma_shift; // 0 or more
};

// Under the tree's light. Cost: some microseconds a triangle; in parallel. Results do not depend on the threads.
CutRings bound_cut_rings(const VertexTree& tree);

} // namespace unseen::vdtree
