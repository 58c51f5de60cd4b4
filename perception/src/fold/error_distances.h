// The test by errors, of errors that are given.
#pragma once

#include "fold/fold_errors.h"
#include "fold/fold_screen.h"

namespace unseen::perception {

// error_distances() of these errors, which are numbers and nest, as parts of a criterion.
vdtree::DistanceCriterion::Parts criterion_parts(std::span<const LitErrors> as_lit, std::span<const FoldStage> stages,
                                                 const vdtree::View& view, const FoldTestOptions& options);

// Distances in mesh units, [stage * bins + bin], from a point of the mesh: beyond, a picture of that stage cannot be
// told from one of the mesh. They grow with the stage, do not grow with the bin, and are infinite where no distance
// will do. Never less than the diameter of the mesh's sphere: from nearer the eye may be among what the pictures show
// from outside. Empty where there are no stages.
std::vector<float> stage_distances(const vdtree::VertexTree& tree, std::span<const FoldStage> stages,
                                   const Screen& screen, const FoldTestOptions& options, std::size_t bins);

} // namespace unseen::perception
