// A build without CGAL.
#include "other_libraries.h"

namespace unseen::app {

bool has_cgal() noexcept { return false; }

Result<Repaired> repair_by_cgal(vdtree::Mesh&&, double, double) {
    return Error{ErrorCode::unsupported, "This build has no --repair, for it was made without CGAL: configure it with "
                                         "-DUNSEEN_WITH_CGAL=ON."};
}

Result<ExactCheck> verify_by_cgal(const vdtree::VertexTree&, const Progress&) {
    return Error{ErrorCode::unsupported, "This build has no --exact, for it was made without CGAL: configure it with "
                                         "-DUNSEEN_WITH_CGAL=ON."};
}

std::string licence_notes() { return {}; }

} // namespace unseen::app
