// What the command does by libraries that a build may lack: OpenMesh's clusterer, CGAL's repair and exact checks.
#pragma once

#include <cstdint>
#include <string>

#include <unseen/vdtree/builder.h>

namespace unseen::app {

// Whether this build has them. Without, the functions below fail, and say how to get them.
bool has_openmesh() noexcept;

Result<vdtree::VertexTree> build_by_openmesh(const vdtree::MeshView& mesh, const vdtree::BuildOptions& options);

} // namespace unseen::app
