// Folds a tree in stages, and measures what pictures of them show.
#pragma once

#include <span>
#include <vector>

#include <vdtree/vertex_tree.h>

#include "fold/fold_errors.h"
#include "measure/fold_stages.h"
#include "measure/measuring_progress.h"

namespace unseen::perception {

// Reads the errors, and notes in which stage every node folds. No stages for trees with translucent vertices, and of no
// extent. Cost: some hundred pictures of up to half of the triangles; in parallel.
// Goes on to all of what is to be done; where that says to stop, the answer is of no use.
std::vector<FoldStage> find_stages(const vdtree::SoundTree& tree, std::span<FoldError> errors,
                                   MeasuringProgress& progress);

} // namespace unseen::perception
