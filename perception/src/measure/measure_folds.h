// The measurement of folds without what follows from it for the whole mesh.
#pragma once

#include <span>
#include <vector>

#include <vdtree/function_ref.h>
#include <vdtree/result.h>
#include <vdtree/vertex_tree.h>

#include "measure/fold_record.h"

namespace unseen::perception {

struct MeasuredFolds { // by interior node
    std::vector<FoldRecord> folds;
    std::vector<FoldFacing> facing;
    std::vector<FoldTexture> textures; // of textured trees; else empty
};

// What a tree's nodes are given as luminance.
using Shading = Callback<float(vdtree::NodeId)>;

// As measure_folds(), without its stages, for several luminances at once. Which neighbours are folded with a node is the
// same for all, so they share what is measured of lengths, and where surfaces touch. By shading. Precondition: one,
// three or four of them; of a textured tree one or four. `dark`: by shading, what it is where a texture is black.
Result<std::vector<MeasuredFolds>> measure_records(const vdtree::VertexTree& tree, std::span<const Shading> shadings,
                                                   std::span<const float> dark, int threads, const Progress& progress);

// The tree with these as measure_folds() keeps them, and no stages.
Result<vdtree::VertexTree> with_records(const vdtree::VertexTree& tree, MeasuredFolds measured);

} // namespace unseen::perception
