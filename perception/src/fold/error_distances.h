// The test by errors, of errors that are given.
#pragma once

#include <span>

#include <unseen/perception/criterion.h>

#include "fold/band_elevation.h"
#include "fold/fold_errors.h"
#include "fold/lit_trees.h"

namespace unseen::perception {

// error_distances() of a tree whose errors these are: with sound arguments, and errors that are numbers and nest.
Result<vdtree::DistanceCriterion> criterion_of(const vdtree::SoundTree& tree, const FoldErrors& measured,
                                               const vdtree::View& view, const FoldTestOptions& options);

// error_distances() of these, where something masks what folds change, as parts of a criterion.
vdtree::DistanceCriterion::Parts criterion_parts(std::span<const LitErrors> as_lit, std::span<const FoldStage> stages,
                                                 const vdtree::View& view, const FoldTestOptions& options,
                                                 const BandElevation& masking);

} // namespace unseen::perception
