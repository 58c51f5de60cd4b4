// Trees of meshes that are known to build, and to be measured.
#pragma once

#include <stdexcept>
#include <utility>

#include <vdtree/builder.h>
#include <vdtree/conserve_light.h>
#include <vdtree/fold_errors.h>
#include <vdtree/mesh.h>

namespace unseen::support {

inline vdtree::VertexTree built(const vdtree::Mesh& mesh, const vdtree::BuildOptions& options = {}) {
    Result<vdtree::VertexTree> tree = vdtree::build_tree(mesh.view(), options);
    if (!tree) throw std::runtime_error("the test's mesh does not build: " + tree.error().message);
    return std::move(*tree);
}

// With its light conserved, and the errors of its folds.
inline vdtree::VertexTree measured(const vdtree::VertexTree& tree, int threads = 1) {
    const Result<vdtree::VertexTree> conserved = vdtree::conserve_light(tree);
    if (!conserved) throw std::runtime_error("the test's tree does not conserve light: " + conserved.error().message);
    Result<vdtree::VertexTree> with_errors = vdtree::with_fold_errors(*conserved, threads);
    if (!with_errors) throw std::runtime_error("the test's tree cannot be measured: " + with_errors.error().message);
    return std::move(*with_errors);
}

} // namespace unseen::support
