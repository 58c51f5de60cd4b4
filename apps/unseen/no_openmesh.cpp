// A build without OpenMesh.
#include "other_libraries.h"

namespace unseen::app {

bool has_openmesh() noexcept { return false; }

Result<vdtree::VertexTree> build_by_openmesh(const vdtree::MeshView&, const vdtree::BuildOptions&) {
    return Error{ErrorCode::unsupported, "This build has no --clusterer openmesh, for it was made without OpenMesh: "
                                         "configure it with -DUNSEEN_WITH_OPENMESH=ON."};
}

} // namespace unseen::app
