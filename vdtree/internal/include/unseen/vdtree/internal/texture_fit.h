// Affine maps from a texture to the surface that it lies on, one a wedge, and how far the vertices around are from them.
#pragma once

#include <cmath>

#include <unseen/vdtree/internal/texture_pyramid.h>
#include <unseen/vdtree/internal/tree_parts.h>
#include <unseen/vdtree/internal/vertex_tree_data.h>

namespace unseen::vdtree {

// By wedge of an interior node: fitted to the corners of the triangles around its leaves; where texture coordinates fit no
// map at all, to their positions' middle. Distances hold whatever the map is: points interpolated between vertices are no
// farther from it than these.
class TextureFits {
public:
    TextureFits() = default;
    // The geometry must stay where it is. Cost: one pass over triangles and wedges.
    TextureFits(const TreeGeometry& geometry, const TreeParts& parts);

    // Mesh units: how far the map of a wedge sends a vertex (any wedge) from where it is.
    double residual(WedgeId map_of, WedgeId vertex) const {
        const Map& map = maps_[map_of];
        const glm::vec2 uv = g_->uvs[vertex];
        const glm::dvec3 p(g_->positions[vertex]);
        const glm::dvec3 off =
            map.at + static_cast<double>(uv.x) * map.along_u + static_cast<double>(uv.y) * map.along_v - p;
        const double squared = off.x * off.x + off.y * off.y + off.z * off.z;
        return squared >= 0 ? std::sqrt(squared) : std::numeric_limits<double>::infinity(); // NaN: no map
    }

    // The largest of the leaves and proxies under a node, itself included, each by the wedge of the node that holds it;
    // where they are very many, what is known without looking.
    double residual_of_subtree(NodeId node) const;

    // Whether leaves and proxies under a node differ in texture coordinates from its wedges that hold them.
    bool moves(NodeId node) const { return moves_[node]; }

private:
    struct Map {
        glm::dvec3 at, along_u, along_v;
    };
    const TreeGeometry* g_ = nullptr;
    std::vector<Map> maps_;
    std::vector<std::uint8_t> moves_;
};

} // namespace unseen::vdtree
