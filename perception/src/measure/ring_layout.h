// The triangles around a node before and after its fold.
#pragma once

#include <iterator>

#include <unseen/vdtree/internal/slab_axes.h>
#include <unseen/vdtree/vertex_tree.h>

#include "measure/nearest_points.h"

namespace unseen::perception {

// The directions that triangles face.
class NormalReach {
public:
    template <std::size_t channels>
    void insert(const RingTriangle<channels>& t) {
        const glm::vec3 a = t.corner[0].position;
        glm::vec3 n = glm::cross(t.corner[1].position - a, t.corner[2].position - a);
        const float squared = glm::dot(n, n);
        if (!(squared > 0)) return;
        n /= std::sqrt(squared);
        const auto along = vdtree::along_slab_axes(n.x, n.y, n.z);
        for (std::size_t i = 0; i < along.size(); ++i)
            low_[i] = std::min(low_[i], along[i]), high_[i] = std::max(high_[i], along[i]);
    }
    vdtree::NormalSlabs slabs() const {
        constexpr float margin = 1e-3f; // a hundred times the rounding of a normal
        return low_[0] > high_[0] ? vdtree::NormalSlabs() : vdtree::slabs_between(low_, high_, margin);
    }

private:
    vdtree::SlabCoordinates<float> low_ = {2, 2, 2, 2, 2, 2, 2}, high_ = {-2, -2, -2, -2, -2, -2, -2};
};

// The triangles with a corner in a node's support: with the neighbours folded that are folded by then, and with none.
template <std::size_t channels>
struct Ring {
    std::vector<RingTriangle<channels>> before, after, fine_before, fine_after;
    std::vector<vdtree::NodeId> shown; // corners of the crossing triangles, folded
    struct Child {
        vdtree::Index first_leaf;
        vdtree::NodeId node;
    };
    std::vector<Child> children;

    void clear() {
        for (auto* surface : {&before, &after, &fine_before, &fine_after}) surface->clear();
        shown.clear();
        children.clear();
    }
};

inline bool are_distinct(const std::array<vdtree::NodeId, 3>& nodes) {
    return nodes[0] != nodes[1] && nodes[1] != nodes[2] && nodes[2] != nodes[0];
}

// Lays out the ring of a node; returns what its triangles face. `points`: of all nodes. `crossing`: triangles with a
// corner in the support that the children, folded, leave. `stand_in`: the node that stands for a leaf outside.
template <std::size_t channels, class StandIn>
NormalReach lay_out(const vdtree::SoundTree& tree, std::span<const LitPointOf<channels>> points, vdtree::NodeId node,
                    std::span<const vdtree::Index> crossing, const StandIn& stand_in, Ring<channels>& ring) {
    using vdtree::Index, vdtree::NodeId;
    using Child = typename Ring<channels>::Child;
    const NodeId interior = tree.interior_count();
    const std::span<const vdtree::Triangle> triangles = tree.triangles();
    const std::span<const Index> first_leaf = tree.first_leaf();
    const Index first_vanishing = tree.first_triangle()[node], end_vanishing = tree.first_triangle()[node + 1];
    const Index begin = first_leaf[node], end = tree.leaf_end()[node];
    const auto is_inside = [&](Index leaf) { return leaf - begin < end - begin; };
    ring.clear();
    std::vector<Child>& children = ring.children;
    tree.for_each_child(node, [&](NodeId child) {
        children.push_back({tree.is_leaf(child) ? child - interior : first_leaf[child], child});
    });
    const auto child_of = [&](Index leaf) {
        const auto after = std::upper_bound(children.begin(), children.end(), leaf,
                                            [](Index l, const Child& child) { return l < child.first_leaf; });
        return std::prev(after)->node;
    };
    NormalReach turned;
    const auto add = [&](std::vector<RingTriangle<channels>>& surface, const RingTriangle<channels>& t) {
        surface.push_back(t);
        turned.insert(t);
    };
    for (const Index t : crossing) {
        RingTriangle<channels> whole, before, after;
        std::array<NodeId, 3> shown, shown_before;
        whole.inside = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            const Index leaf = triangles[t][k];
            const bool is_here = is_inside(leaf);
            whole.corner[k] = points[interior + leaf];
            whole.inside |= static_cast<unsigned>(is_here) << k;
            shown[k] = is_here ? node : stand_in(leaf);
            shown_before[k] = is_here ? child_of(leaf) : shown[k];
        }
        before.inside = after.inside = whole.inside;
        for (std::size_t k = 0; k < 3; ++k) {
            before.corner[k] = points[shown_before[k]];
            after.corner[k] = points[shown[k]];
        }
        ring.shown.insert(ring.shown.end(), shown.begin(), shown.end());
        turned.insert(whole);
        if (are_distinct(shown_before)) add(ring.before, before);
        RingTriangle<channels> fine_before = whole;
        std::array<NodeId, 3> shown_fine = shown_before;
        for (std::size_t k = 0; k < 3; ++k) {
            if ((whole.inside >> k) & 1) fine_before.corner[k] = before.corner[k];
            else shown_fine[k] = interior + triangles[t][k];
        }
        if (are_distinct(shown_fine)) ring.fine_before.push_back(fine_before);
        if (t >= first_vanishing && t < end_vanishing) continue; // vanishes here
        RingTriangle<channels> fine = whole;
        for (std::size_t k = 0; k < 3; ++k)
            if ((whole.inside >> k) & 1) fine.corner[k] = points[node];
        add(ring.fine_after, fine);
        if (are_distinct(shown)) add(ring.after, after);
    }
    return turned;
}

// The mean distance of the ring's other corners from the proxy.
template <std::size_t channels>
float mean_reach(std::span<const RingTriangle<channels>> ring, const LitPointOf<channels>& proxy) {
    float sum = 0;
    int count = 0;
    for (const RingTriangle<channels>& t : ring) {
        for (std::size_t k = 0; k < 3; ++k) {
            if ((t.inside >> k) & 1) continue;
            sum += glm::length(t.corner[k].position - proxy.position);
            ++count;
        }
    }
    return count > 0 ? sum / static_cast<float>(count) : 0;
}

} // namespace unseen::perception
