// Private to perception: what has to hold of a tree before anything walks up by its parents.
#pragma once

#include <string>

#include <vdtree/vertex_tree.h>

namespace unseen::perception {

// Of trees from map_tree() nobody has looked at all nodes: a damaged one could name any parent. Cost: a nanosecond a node.
inline Result<void> check_parents(const vdtree::VertexTree& tree) {
    for (vdtree::NodeId node = 1; node < tree.interior_count(); ++node)
        if (!(tree.parents()[node] < node))
            return Error{ErrorCode::malformed_data,
                         "Node " + std::to_string(node) + " of the tree is damaged: its parent does not come before it. Build the tree again from its mesh."};
    return {};
}

} // namespace unseen::perception
