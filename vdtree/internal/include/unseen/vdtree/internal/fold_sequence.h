// The mesh while it is folded one node after the other: which triangles are drawn around which nodes.
#pragma once

#include <algorithm>

#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/vertex_tree_data.h>

namespace unseen::vdtree {

class FoldSequence {
public:
    explicit FoldSequence(const SoundTree& tree)
        : tree_(tree), corners_(tree.triangles().begin(), tree.triangles().end()), around_(tree.node_count()) {
        for (Index t = 0; t < corners_.size(); ++t)
            for (NodeId& corner : corners_[t]) around_[corner = tree.place_of_leaf(corner)].push_back(t);
    }

    // Folds a node whose interior children have been folded. Calls leave(triangle) for each triangle that is drawn
    // around the children; what it becomes is in ring() afterwards. Cost: the triangles around the node.
    template <class F>
    void fold(NodeId node, F&& leave) {
        std::vector<Index>& ring = around_[node];
        tree_.for_each_child(node, [&](NodeId child) {
            for (const Index t : around_[child]) {
                Triangle& at = corners_[t];
                const bool is_new = at[0] != node && at[1] != node && at[2] != node; // else another child's, too
                if (is_new && are_distinct(at)) leave(t);
                for (NodeId& corner : at)
                    if (corner == child) corner = node;
            }
            ring.insert(ring.end(), around_[child].begin(), around_[child].end());
            std::vector<Index>().swap(around_[child]);
        });
        std::sort(ring.begin(), ring.end());
        ring.erase(std::unique(ring.begin(), ring.end()), ring.end());
        std::erase_if(ring, [&](Index t) { return !are_distinct(corners_[t]); });
    }

    // The triangles that are drawn around a node which has been folded; the nodes at their corners, and the wedges.
    std::span<const Index> ring(NodeId node) const { return around_[node]; }
    const Triangle& corners(Index triangle) const { return corners_[triangle]; }
    std::array<WedgeId, 3> wedges(Index triangle) const {
        std::array<WedgeId, 3> out;
        for (std::size_t k = 0; k < 3; ++k)
            out[k] = tree_.wedge_at(corners_[triangle][k], tree_.triangles()[triangle][k]);
        return out;
    }

    glm::vec3 vector_area(Index triangle) const {
        const Triangle& t = corners_[triangle];
        const glm::vec3& a = tree_.position(t[0]);
        return 0.5f * glm::cross(tree_.position(t[1]) - a, tree_.position(t[2]) - a);
    }

private:
    static bool are_distinct(const Triangle& t) { return t[0] != t[1] && t[1] != t[2] && t[2] != t[0]; }

    const SoundTree& tree_;
    std::vector<Triangle> corners_;          // nodes that are shown
    std::vector<std::vector<Index>> around_; // by node that is shown
};

// ---- units

// A power of two that brings a radius to between 1 and 2. 1 for 0 and non-finite radii, and for ordinary ones, whose sixth
// powers neither over- nor underflow. Lengths times it and back are exact.
float unit_scale(float radius);

// Positions and spheres times a power of two, relative to the origin. All else is viewed in the given geometry, which
// it keeps alive; displacements are as they were.
std::shared_ptr<const TreeGeometry> scaled_geometry(const std::shared_ptr<const TreeGeometry>& given, float scale);

} // namespace unseen::vdtree
