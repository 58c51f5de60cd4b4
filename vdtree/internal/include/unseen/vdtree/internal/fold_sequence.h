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

    // Calls use(node) for all nodes, which folds them. All comes out as if they folded in the order of their ranks, of which
    // no parent's is below a child's. But that order goes all over the mesh with every step. Here it holds where it matters,
    // among nodes that share a triangle, and the rest goes piece by piece, so that the caches hold what is next.
    template <class Use>
    void fold_all(std::span<const NodeId> in_order, Use&& use) {
        std::vector<Index> ranks(in_order.size());
        for (Index rank = 0; rank < in_order.size(); ++rank) ranks[in_order[rank]] = rank;
        std::vector<bool> is_folded(in_order.size());
        std::vector<NodeId> waiting;
        for (NodeId next = tree_.interior_count(); next-- > 0;) {
            waiting.push_back(next);
            while (!waiting.empty()) {
                const NodeId node = waiting.back();
                const NodeId before = is_folded[node] ? no_node : folds_before(node, ranks, is_folded);
                if (before != no_node) {
                    waiting.push_back(before);
                    continue;
                }
                waiting.pop_back();
                if (is_folded[node]) continue;
                use(node);
                is_folded[node] = true;
            }
        }
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
    // A child that has not folded yet, or a node of a lower rank that shares a triangle; no_node where there is none.
    NodeId folds_before(NodeId node, std::span<const Index> ranks, const std::vector<bool>& is_folded) const {
        const auto parents = tree_.parents();
        NodeId found = no_node;
        tree_.for_each_child(node, [&](NodeId child) {
            if (found != no_node) return;
            if (!tree_.is_place(child) && !is_folded[child]) found = child;
            for (const Index t : around_[child]) {
                if (!are_distinct(corners_[t]))
                    continue; // not drawn any more; of what is, no corner's parent has folded
                for (const NodeId corner : corners_[t])
                    if (ranks[parents[corner]] < ranks[node]) found = parents[corner];
                if (found != no_node) return;
            }
        });
        return found;
    }

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
