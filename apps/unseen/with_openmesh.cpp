// A build with OpenMesh.
#include <unseen/openmesh/decimater_clusterer.h>

#include "other_libraries.h"

namespace unseen::app {

bool has_openmesh() noexcept { return true; }

Result<vdtree::VertexTree> build_by_openmesh(const vdtree::MeshView& mesh, const vdtree::BuildOptions& options) {
    return openmesh::build_tree_by_decimater(mesh, options);
}

} // namespace unseen::app
