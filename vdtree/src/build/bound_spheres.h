// Spheres around what each node supports and what surrounds it.
#pragma once

#include "tree/leaf_rings.h"

namespace unseen::vdtree {

// What is measured of a tree: its shape, parts and rings, and the positions by node.
struct BoundInput {
    const TreeShape& shape;
    const TreeParts& parts;
    const LeafRings& rings;
    std::span<const glm::vec3> positions;

    glm::dvec3 position(NodeId node) const { return glm::dvec3(positions[node]); }
    glm::dvec3 leaf_position(Index leaf) const { return position(shape.place_of_leaf(leaf)); }
};

// By interior node. Each sphere contains those of the node's children exactly.
struct NodeSpheres {
    std::vector<Sphere> support; // leaves and proxies of the subtree; radius 0: all at one point
    std::vector<Sphere> ring;    // the same and the corners of all triangles around
};
NodeSpheres bound_spheres(const BoundInput& input);

// Around the corners of all triangles.
Sphere bound_corners(const BoundInput& input);

} // namespace unseen::vdtree
