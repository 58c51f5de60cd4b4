// Where the proxies are and what they look like: area-weighted means of their leaves.
#pragma once

#include <unseen/vdtree/internal/tree_parts.h>

namespace unseen::vdtree {

struct LeafVertices {
    const MeshView& mesh;
    std::span<const Index> sources;     // by leaf: the mesh's vertex
    std::span<const double> areas;      // by leaf
    std::span<const glm::vec3> normals; // by leaf
    glm::dvec3 origin;                  // of the tree's positions
};

// Proxies that the clusterer has placed: by cluster that is no vertex, and the node of each, or no_node. May be empty.
struct GivenProxies {
    std::span<const glm::dvec3> positions;
    std::span<const NodeId> nodes;
};

// By node, leaves included.
struct ProxyVertices {
    std::vector<glm::vec3> positions;
    std::vector<PackedNormal>
        normals; // luminance is derived from these, so that other light gives what building with it would
    std::vector<glm::vec4> colours; // empty where the mesh has none; likewise the next
    std::vector<glm::vec2> uvs;
};
// Proxies of coincident leaves are exactly where these are; those of leaves with equal texture coordinates have exactly
// these if the mesh has a texture.
ProxyVertices place_proxies(const TreeShape& shape, const TreeParts& parts, const LeafVertices& leaves,
                            const GivenProxies& given);

} // namespace unseen::vdtree
