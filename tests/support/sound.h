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

} // namespace unseen::support
