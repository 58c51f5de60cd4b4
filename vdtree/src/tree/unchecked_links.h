// How the nodes of a tree hang together, as its file says: for what asks VertexTree::is_sound() about each node before
// it follows that node's links, and so need not look at the whole tree. Everything else takes a SoundTree.
#pragma once

#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

struct UncheckedLinks {
    static const auto& of(const VertexTree& tree) noexcept { return tree.links_; }
};

// Links of the tree's nodes by name: parents, subtree_end, first_leaf, leaf_end, first_triangle, triangles.
inline const auto& unchecked_links(const VertexTree& tree) noexcept { return UncheckedLinks::of(tree); }

} // namespace unseen::vdtree
