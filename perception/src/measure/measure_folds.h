// The measurement of folds without what follows from it for the whole mesh.
#pragma once

#include <vector>

#include <vdtree/function_ref.h>
#include <vdtree/result.h>
#include <vdtree/vertex_tree.h>

#include "measure/fold_record.h"

namespace unseen::perception {

struct MeasuredFolds { // by interior node
    std::vector<FoldRecord> folds;
    std::vector<FoldFacing> facing;
};

// As measure_folds(), without its stages.
Result<MeasuredFolds> measure_records(const vdtree::VertexTree& tree, int threads, const Progress& progress);

// The tree with these as measure_folds() keeps them, and no stages.
Result<vdtree::VertexTree> with_records(const vdtree::VertexTree& tree, MeasuredFolds measured);

} // namespace unseen::perception
