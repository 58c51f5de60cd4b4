// The links of trees in tests.
#pragma once

#include <stdexcept>
#include <utility>

#include <unseen/vdtree/vertex_tree.h>

namespace unseen::support {

// A tree that is known to be in order.
inline vdtree::SoundTree sound(const vdtree::VertexTree& tree) {
    auto sound = vdtree::SoundTree::of(tree);
    if (!sound) throw std::runtime_error(sound.error().message);
    return std::move(*sound);
}

// The node that a wedge belongs to.
inline vdtree::NodeId node_of(const vdtree::VertexTree& tree, vdtree::WedgeId wedge) {
    if (!tree.has_seams()) return wedge;
    vdtree::NodeId first = 0, end = tree.node_count();
    while (end - first > 1) {
        const vdtree::NodeId middle = first + (end - first) / 2;
        (tree.first_wedge(middle) <= wedge ? first : end) = middle;
    }
    return first;
}

} // namespace unseen::support
