// The test by errors, of errors that are given.
#pragma once

#include <perception/criterion.h>

#include "fold/band_elevation.h"
#include "fold/fold_errors.h"

namespace unseen::perception {

// error_distances() of a tree whose errors these are: with sound arguments, and errors that are numbers and nest.
Result<vdtree::DistanceCriterion> criterion_of(const vdtree::SoundTree& tree, const FoldErrors& measured,
                                               const vdtree::View& view, const FoldTestOptions& options);

// The same, where something masks what folds change, as parts of a criterion.
vdtree::DistanceCriterion::Parts criterion_parts(const vdtree::SoundTree& tree, const FoldErrors& measured,
                                                 const vdtree::View& view, const FoldTestOptions& options,
                                                 const BandElevation& masking);

} // namespace unseen::perception
