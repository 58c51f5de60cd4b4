// Trees whose folds are known to be measurable.
#pragma once

#include <stdexcept>
#include <utility>

#include <unseen/perception/fold_measurement.h>
#include <unseen/vdtree/internal/conserve_light.h>

#include "built.h"

namespace unseen::support {

// With its light conserved, where that is not a texture's, and what its folds change.
inline vdtree::VertexTree measured(const vdtree::VertexTree& tree, int threads = 1) {
    const Result<vdtree::VertexTree> conserved =
        tree.texture().empty() ? vdtree::conserve_light(tree) : Result<vdtree::VertexTree>(tree.share());
    if (!conserved) throw std::runtime_error("the test's tree does not conserve light: " + conserved.error().message);
    Result<vdtree::VertexTree> with_folds = perception::measure_folds(*conserved, threads);
    if (!with_folds) throw std::runtime_error("the test's tree cannot be measured: " + with_folds.error().message);
    return std::move(*with_folds);
}

} // namespace unseen::support
