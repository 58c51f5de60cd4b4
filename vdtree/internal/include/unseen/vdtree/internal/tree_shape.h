// The nodes of a tree while it is being built: how they are numbered and when the clusterer made them.
#pragma once

#include <unseen/vdtree/builder.h>

namespace unseen::vdtree {

// How the nodes hang together; numbered as in <unseen/vdtree/vertex_tree.h>: interior nodes depth-first, then the places.
template <class Numbers>
struct LinksIn : WedgeLinks<Numbers> {
    // Calls on_child for each interior child, and on_leaf for each leaf of a child that is a place, in depth-first order.
    template <class Child, class Leaf>
    void for_each_child(NodeId node, Child&& on_child, Leaf&& on_leaf) const {
        NodeId child = node + 1;
        const NodeId child_end = this->subtree_end[node];
        const Index end = this->leaf_end[node];
        for (Index leaf = this->first_leaf[node]; leaf < end;) {
            if (child < child_end && this->first_leaf[child] == leaf) {
                on_child(child);
                leaf = this->leaf_end[child];
                child = this->subtree_end[child];
            } else {
                on_leaf(leaf++);
            }
        }
    }
};

// Views of a tree's arrays.
using TreeLinks = LinksIn<std::span<const NodeId>>;
template <class Arrays>
TreeLinks links_of(const Arrays& tree) {
    return {{{tree.several, tree.extra_wedges, tree.further, tree.leaf_ranks, tree.wedge_ranks},
             tree.parents,
             tree.first_leaf,
             tree.leaf_end,
             tree.subtree_end}};
}

// The same while the tree is being built.
struct TreeShape : LinksIn<std::vector<NodeId>> {
    std::vector<Index> made; // by interior node: the number of its cluster, higher than its children's
};

// Shortcuts up the tree, so that looking for an ancestor costs the logarithm of the depth however deep the tree is.
// After Myers, "An applicative random-access stack", 1983.
class Ancestors {
public:
    explicit Ancestors(const TreeShape& shape);

    // The lowest of `node` and its ancestors that `found` accepts; with a node, it must accept all that are above.
    // Calls `found` only with interior nodes; there must be one that it accepts.
    template <class Found>
    NodeId lowest(NodeId node, Found&& found) const {
        // Most are near: walk before jumping.
        for (int step = 0; step < steps_before_jumping; ++step) {
            if (found(node)) return node;
            node = shape_.parents[node];
        }
        while (!found(node)) {
            const NodeId far = jump_[node];
            node = far != no_node && !found(far) ? far : shape_.parents[node];
        }
        return node;
    }

    // The highest of `node` and its ancestors that was made at `time` or before; `node` is one.
    NodeId highest_made_by(NodeId node, Index time) const {
        for (;;) {
            const NodeId far = node < jump_.size() ? jump_[node] : no_node;
            const NodeId up = shape_.parents[node];
            if (far != no_node && shape_.made[far] <= time) node = far;
            else if (up != no_node && shape_.made[up] <= time) node = up;
            else return node;
        }
    }

private:
    static constexpr int steps_before_jumping = 16;

    const TreeShape& shape_;
    std::vector<NodeId> jump_; // by interior node: an ancestor
};

} // namespace unseen::vdtree
