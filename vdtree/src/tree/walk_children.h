// Goes to the interior children of many nodes, with what that reads on its way ahead of time.
#pragma once

#include <cstddef>
#include <span>

#include <unseen/vdtree/vertex_tree.h>

#include "cut/kernel/prefetch.h"
#include "tree/unchecked_links.h"

namespace unseen::vdtree {

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
