// Triangles that folds have turned over, and the cut in which none is.
#include <algorithm>

#include <glm/geometric.hpp>

#include "cut/cut_state.h"

namespace unseen::vdtree {

namespace {

// Texture coordinates of thinner triangles than this, as the sine of the angle between two sides, have no side to speak of.
constexpr float least_uv_sine = 1e-3f;

// Twice the area of a triangle in the texture, positive where it runs counter-clockwise; 0 where it is too thin.
float uv_area(glm::vec2 a, glm::vec2 b, glm::vec2 c) {
    const glm::vec2 e = b - a, f = c - a;
    const float area = e.x * f.y - e.y * f.x;
    return std::abs(area) > least_uv_sine * glm::length(e) * glm::length(f) ? area : 0;
}

class TurnedTriangles {
public:
    explicit TurnedTriangles(const Cut& cut)
        : cut_(cut), tree_(cut.tree()), positions_(tree_.positions()), uvs_(tree_.uvs()) {}

    // The coarsest corners of those in the cut, each once.
    std::vector<NodeId> coarsest_corners() const {
        const auto& links = unchecked_links(tree_);
        std::vector<NodeId> nodes;
        for_each_bit(CutState::of(cut_).unfolded(), [&](NodeId node) {
            for (Index t = links.first_triangle[node]; t < links.first_triangle[node + 1]; ++t)
                if (const NodeId corner = coarsest_corner(links.triangles[t]);
                    corner != no_node && is_turned(links.triangles[t]))
                    nodes.push_back(corner);
        });
        std::ranges::sort(nodes);
        nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
        return nodes;
    }

private:
    // no_node: all three stand where they stood.
    NodeId coarsest_corner(const Triangle& leaves) const {
        NodeId coarsest = no_node;
        float largest = -1;
        for (const Index leaf : leaves) {
            const NodeId node = cut_.proxy_of_leaf(leaf);
            if (tree_.is_place(node)) continue;
            const float radius = tree_.support_spheres()[node].radius;
            if (radius > largest || (radius == largest && node < coarsest)) coarsest = node;
            largest = std::max(largest, radius);
        }
        return coarsest;
    }

    bool is_turned(const Triangle& leaves) const {
        std::array<WedgeId, 3> now, before;
        for (std::size_t k = 0; k < 3; ++k) {
            now[k] = cut_.wedge_of_leaf(leaves[k]);
            before[k] = tree_.wedge_of_leaf(leaves[k]);
        }
        if (glm::dot(normal(now), normal(before)) < 0) return true;
        if (uvs_.empty()) return false;
        const float area = uv_area(uvs_[now[0]], uvs_[now[1]], uvs_[now[2]]),
                    was = uv_area(uvs_[before[0]], uvs_[before[1]], uvs_[before[2]]);
        return (area < 0 && was > 0) || (area > 0 && was < 0);
    }

    // Of any length, in double: triangles of a large model may be tiny.
    glm::dvec3 normal(const std::array<WedgeId, 3>& at) const {
        const glm::dvec3 a(positions_[at[0]]);
        return glm::cross(glm::dvec3(positions_[at[1]]) - a, glm::dvec3(positions_[at[2]]) - a);
    }

    const Cut& cut_;
    const VertexTree& tree_;
    std::span<const glm::vec3> positions_;
    std::span<const glm::vec2> uvs_;
};

} // namespace

// Each round unfolds what is coarsest, so that it ends: a triangle of three places is as it was.
Index Cut::unfold_turned() {
    Index unfolded = 0;
    const TurnedTriangles turned(*this);
    for (;;) {
        Index changed = 0;
        for (const NodeId node : turned.coarsest_corners()) changed += unfold(node);
        if (changed == 0) return unfolded;
        unfolded += changed;
    }
}

} // namespace unseen::vdtree
