// Numbers the nodes of a clustering depth-first, and its triangles by the node at which they vanish.
#pragma once

#include <unseen/vdtree/internal/tree_shape.h>

namespace unseen::vdtree {

struct NodeOrder {
    TreeShape shape;
    std::vector<Index> leaf_of_vertex;   // by vertex of the clustering
    std::vector<NodeId> node_of_cluster; // by cluster that is no vertex; no_node for those with one child
};

// Depth-first pre-order, children in the order of their clusters, passing over clusters with one child. Cost: two
// passes over the clusters.
NodeOrder order_nodes(const Clustering& clustering, Index vertices);

struct TriangleOrder {
    std::vector<Index> first_triangle; // by interior node, one longer
    std::vector<Triangle> triangles;   // over leaves
    std::vector<Index> sources;        // by triangle: its number in `triangles` as given
};

// By the deepest node that supports two corners; triangles that vanish at one node keep their order.
TriangleOrder order_triangles(std::span<const Triangle> triangles, const NodeOrder& nodes, const Ancestors& ancestors);

} // namespace unseen::vdtree
