// Where the proxies are: where the clusterer put them, or at the area-weighted means of their places.
#pragma once

#include <unseen/vdtree/internal/tree_parts.h>

namespace unseen::vdtree {

struct PlacesToMerge {
    std::span<const glm::dvec3> positions; // by vertex of the clustering
    std::span<const double> areas;         // likewise
    std::span<const Index> leaf_of_vertex; // likewise: its number in the tree
    glm::dvec3 origin;                     // of the tree's positions
};

// Proxies that the clusterer has placed: by cluster that is no vertex, and the node of each, or no_node. May be empty.
struct GivenProxies {
    std::span<const glm::dvec3> positions;
    std::span<const NodeId> nodes;
};

// By node, places included. Proxies of places that floats do not tell apart are exactly where these are.
std::vector<glm::vec3> place_proxies(const TreeShape& shape, const TreeParts& parts, const PlacesToMerge& places,
                                     const GivenProxies& given);

} // namespace unseen::vdtree
