// Affine maps from a texture to the surface that it lies on, one a node, and how far the vertices around the node are
// from them.
#pragma once

#include <cmath>

#include <unseen/vdtree/internal/texture_pyramid.h>
#include <unseen/vdtree/internal/tree_parts.h>
#include <unseen/vdtree/internal/vertex_tree_data.h>

namespace unseen::vdtree {

// Fitted to the corners of the ring; where texture coordinates fit no map at all, to their positions' middle. Distances
// hold whatever the map is: points interpolated between vertices are no farther from it than these.
class TextureFits {
public:
    TextureFits() = default;
    // The geometry must stay where it is. Cost: one pass over triangles and leaves.
    TextureFits(const TreeGeometry& geometry, const TreeParts& parts);

    // Mesh units: how far the map of an interior node sends a vertex (leaf or proxy) from where it is.
    double residual(NodeId node, NodeId vertex) const {
        const Map& map = maps_[node];
        const glm::vec2 uv = g_->uvs[vertex];
        const glm::dvec3 p(g_->positions[vertex]);
        const glm::dvec3 off =
            map.at + static_cast<double>(uv.x) * map.along_u + static_cast<double>(uv.y) * map.along_v - p;
        const double squared = off.x * off.x + off.y * off.y + off.z * off.z;
        return squared >= 0 ? std::sqrt(squared) : std::numeric_limits<double>::infinity(); // NaN: no map
    }

    // The largest of the leaves and proxies under a node, itself included; where they are very many, what is known
    // without looking.
    double residual_of_subtree(NodeId node) const;

    // Texture coordinates of all vertices, those of proxies where their maps have the place nearest to the proxy,
    // within the footprints: so that a fold slides the texture over the surface as little as can be. Where a fold moves
    // nothing, and without a map, they stay.
    std::vector<glm::vec2> fitted_uvs(const std::vector<UvBox>& footprints) const;

    // Whether leaves and proxies under a node differ in texture coordinates.
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
