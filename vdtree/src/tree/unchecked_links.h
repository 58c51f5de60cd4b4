// How the nodes of a tree hang together, as its file says: for what asks VertexTree::is_sound() about each node before
// it follows that node's links, and so need not look at the whole tree. Everything else takes a SoundTree.
#pragma once

#include <unseen/vdtree/internal/simd.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

struct UncheckedLinks {
    static const auto& of(const VertexTree& tree) noexcept { return tree.links_; }
};

// Links of the tree's nodes by name: parents, subtree_end, first_leaf, leaf_end, first_triangle, triangles.
inline const auto& unchecked_links(const VertexTree& tree) noexcept { return UncheckedLinks::of(tree); }

// Calls f(i, child) for the interior children of node_at(i), for all i below `count`, in order. The nodes must be
// sound.
template <class NodeAt, class F>
void walk_children(const VertexTree& tree, std::size_t count, NodeAt node_at, F&& f) {
    // Places between a prefetch and its use: first the node's own link; then that of its second child, which most have
    // and which is anywhere. (The first one is the node's neighbour.)
    constexpr std::size_t far = 32, near = 16;
    const auto subtree_end = unchecked_links(tree).subtree_end;
    const auto prefetch_second = [&](NodeId node) {
        if (const NodeId child = node + 1, end = subtree_end[node]; child < end && subtree_end[child] < end)
            prefetch(&subtree_end[subtree_end[child]]);
    };
    for (std::size_t i = 0; i < count && i < far; ++i) prefetch(&subtree_end[node_at(i)]);
    for (std::size_t i = 0; i < count && i < near; ++i) prefetch_second(node_at(i));
    for (std::size_t i = 0; i < count; ++i) {
        if (i + far < count) prefetch(&subtree_end[node_at(i + far)]);
        if (i + near < count) prefetch_second(node_at(i + near));
        const NodeId node = node_at(i), end = subtree_end[node];
        for (NodeId child = node + 1; child < end; child = subtree_end[child]) f(i, child);
    }
}

} // namespace unseen::vdtree
