// Another library's simplification of the same mesh, for comparison: meshoptimizer's, which knows no view.
#pragma once

#include <cstddef>

#include <unseen/vdtree/mesh.h>

namespace unseen::app {

bool has_meshoptimizer(); // whether this build does

// At most so many triangles, or as few as its topology allows, over vertices of the mesh, with their attributes.
// `whatever_it_takes`: where topology allows no more, as `gltfpack -sa` does it, by clusters of a grid (none may be left).
// Precondition: it has; the mesh has triangles.
vdtree::Mesh simplified_by_meshoptimizer(const vdtree::Mesh& mesh, std::size_t triangles,
                                         bool whatever_it_takes = false);

} // namespace unseen::app
