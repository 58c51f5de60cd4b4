// Trees of meshes that are known to build.
#pragma once

#include <stdexcept>
#include <utility>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/mesh.h>

namespace unseen::support {

inline vdtree::VertexTree built(const vdtree::Mesh& mesh, const vdtree::BuildOptions& options = {}) {
    Result<vdtree::VertexTree> tree = vdtree::build_tree(mesh.view(), options);
    if (!tree) throw std::runtime_error("the test's mesh does not build: " + tree.error().message);
    return std::move(*tree);
}

} // namespace unseen::support
