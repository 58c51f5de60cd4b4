// Where the proxies are and what they look like: area-weighted means of their leaves.
#pragma once

#include <span>
#include <vector>

#include <unseen/vdtree/internal/tree_parts.h>

namespace unseen::vdtree {

struct LeafVertices {
    const MeshView& mesh;
    std::span<const Index> sources;     // by leaf: the mesh's vertex
    std::span<const double> areas;      // by leaf
    std::span<const glm::vec3> normals; // by leaf
    glm::dvec3 origin;                  // of the tree's positions
};

// By node, leaves included.
struct ProxyVertices {
    std::vector<glm::vec3> positions;
    std::vector<PackedNormal>
        normals; // luminance is derived from these, so that other light gives what building with it would
    std::vector<glm::vec4> colours; // empty where the mesh has none; likewise the next
    std::vector<glm::vec2> uvs;
};
ProxyVertices place_proxies(const TreeShape& shape, const TreeParts& parts, const LeafVertices& leaves);

// Puts proxies of coincident leaves exactly where these are.
void keep_coincident_proxies(const TreeShape& shape, const TreeParts& parts, std::span<glm::vec3> positions);

// Gives proxies of leaves with equal texture coordinates exactly these.
void keep_equal_uvs(const TreeShape& shape, const TreeParts& parts, std::span<glm::vec2> uvs);

} // namespace unseen::vdtree
