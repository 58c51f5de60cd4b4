// Folds a tree in stages, and measures what pictures of them show.
#pragma once

#include <span>
#include <vector>

#include <unseen/vdtree/vertex_tree.h>

#include "fold/fold_errors.h"
#include "measure/fold_stages.h"
#include "measure/lit_stages.h"
#include "measure/measuring_progress.h"
#include "measure/textured_light.h"

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

} // namespace unseen::perception
