// Luminances of proxies with which folds keep the light that the surface sends out.
#pragma once

#include <vector>

#include <vdtree/vertex_tree.h>

namespace unseen::vdtree {

// By node: the leaves' own; of each proxy the one with which its ring sends out what the ring before the fold did, when nodes are
// folded by their size, as near to it as the luminances of the ring go; what is missing, the parents make good. Cost: as of folding
// the mesh once, one node after the other.
std::vector<Unorm16> light_keeping_luminance(const VertexTree& tree);

} // namespace unseen::vdtree
