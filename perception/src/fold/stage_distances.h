// From how far the stages are invisible in which a whole mesh can be folded.
#pragma once

#include <span>
#include <vector>

#include <unseen/perception/criterion.h>
#include <unseen/vdtree/vertex_tree.h>

#include "fold/band_elevation.h"
#include "fold/fold_screen.h"
#include "measure/fold_stages.h"

namespace unseen::perception {

// Distances in mesh units, [stage * bins + bin], from a point of the mesh: beyond, a picture of that stage cannot be
// told from one of the mesh. They grow with the stage, do not grow with the bin, and are infinite where no distance
// will do. Never less than the diameter of the mesh's sphere: from nearer the eye may be among what the pictures show
// from outside. Empty where there are no stages.
std::vector<float> stage_distances(const vdtree::VertexTree& tree, std::span<const FoldStage> stages,
                                   const Screen& screen, const FoldTestOptions& options, const BandElevation& masking,
                                   std::size_t bins);

} // namespace unseen::perception
