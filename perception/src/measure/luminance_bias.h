// What the errors of many folds add up to.
#pragma once

#include <algorithm>
#include <span>

#include <unseen/vdtree/vertex_tree.h>

#include "fold/fold_errors.h"
#include "measure/textured_light.h"

namespace unseen::perception {

// Reads the luminance errors and extents, and adds the bias. Cost: as of folding the mesh once, one node after the
// other. `light`, `textures`: with the tree's texture, where it has one, and what folds make of that.
void find_luminance_bias(const vdtree::SoundTree& tree, const TexturedLight& light,
                         std::span<const FoldTexture> textures, std::span<FoldError> errors);

// The radius of what a fold of the node changes, in mesh units.
inline float changed_radius(const vdtree::VertexTree& tree, std::span<const FoldError> errors, vdtree::NodeId node) {
    return std::max(tree.support_spheres()[node].radius, errors[node].extent);
}

} // namespace unseen::perception
