// What folds change of the whole mesh: what pictures of it show, folded in stages, and what the errors of many folds add
// up to.
#pragma once

#include "fold/fold_errors.h"
#include "measure/measuring_progress.h"
#include "measure/texture_detail.h"

namespace unseen::perception {

// Reads the errors, and notes in which stage every node folds. No stages for trees with translucent vertices, and of no
// extent. `light`, `textures`: with the tree's texture, where it has one, and what folds make of that. Cost: some
// hundred pictures of up to half of the triangles; in parallel. Goes on to all of what is to be done; where that says
// to stop, the answer is of no use.
std::vector<FoldStage> find_stages(const vdtree::SoundTree& tree, const TexturedLight& light,
                                   std::span<const FoldTexture> textures, std::span<FoldError> errors,
                                   MeasuringProgress& progress);

// The same under any lights. `errors`: of folds under light from everywhere. `texture`: dark where the texture is.
// Cost: three to four times as many pictures.
LitStages find_lit_stages(const vdtree::SoundTree& tree, const TexturedLight& texture,
                          std::span<const FoldTexture> textures, std::span<FoldError> errors,
                          MeasuringProgress& progress);

// Reads the luminance errors and extents, and adds the bias. Cost: as of folding the mesh once, one node after the
// other. `light`, `textures`: with the tree's texture, where it has one, and what folds make of that.
void find_luminance_bias(const vdtree::SoundTree& tree, const TexturedLight& light,
                         std::span<const FoldTexture> textures, std::span<FoldError> errors);

// The radius of what a fold of the node changes, in mesh units.
inline float changed_radius(const vdtree::VertexTree& tree, std::span<const FoldError> errors, vdtree::NodeId node) {
    return std::max(tree.support_spheres()[node].radius, errors[node].extent);
}

} // namespace unseen::perception
