// What decides which proxies a ring can have in a cut.
#pragma once

#include <unseen/vdtree/internal/vertex_tree_data.h>

namespace unseen::perception {

inline bool supports(const vdtree::TreeGeometry& g, vdtree::NodeId node, vdtree::Index leaf) {
    return g.first_leaf[node] <= leaf && leaf < g.leaf_end[node];
}

// Ties go by number, so that of two nodes one is the larger.
inline bool is_larger(const vdtree::TreeGeometry& g, vdtree::NodeId a, vdtree::NodeId b) {
    const float ra = g.support_spheres[a].radius, rb = g.support_spheres[b].radius;
    return ra != rb ? ra > rb : a < b;
}

} // namespace unseen::perception
