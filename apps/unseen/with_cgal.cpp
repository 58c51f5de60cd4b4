// A build with CGAL.
#include <unseen/exact/exact.h>
#include <unseen/repair/repair.h>

#include "other_libraries.h"
#include "terminal.h"

namespace unseen::app {

bool has_cgal() noexcept { return true; }

Result<Repaired> repair_by_cgal(vdtree::Mesh&& mesh, double gap, double largest_hole) {
    repair::Options options;
    options.gap = gap;
    options.largest_hole = largest_hole;
    auto repaired = repair::repair(std::move(mesh), options);
    if (!repaired) return repaired.error();
    const repair::Report& r = repaired->report;
    Json json = {
        {"duplicates", r.duplicates}, {"moved_vertices", r.moved_vertices}, {"turned_triangles", r.turned_triangles},
        {"holes", r.holes},           {"capped_holes", r.capped_holes},     {"cap_triangles", r.cap_triangles}};
    std::string sentence = "repaired: " + grouped(r.turned_triangles) + " triangles turned, " +
                           grouped(r.moved_vertices) + " vertices moved to close cracks, " + grouped(r.capped_holes) +
                           " of " + grouped(r.holes) + " holes capped by " + grouped(r.cap_triangles) + " triangles, " +
                           grouped(r.duplicates) + " duplicates left out";
    return Repaired{std::move(repaired->mesh), std::move(json), std::move(sentence)};
}

Result<ExactCheck> verify_by_cgal(const vdtree::VertexTree& tree, const Progress& progress) {
    const auto verified = exact::verify_exactly(tree, progress);
    if (!verified) return verified.error();
    return ExactCheck{verified->comparisons, verified->in_rationals};
}

std::string licence_notes() {
    return "With CGAL's Surface_mesh and Polygon_mesh_processing (--repair), which are under the GPL, version 3 or "
           "later:\n"
           "whoever passes on this program has to do so under that licence. Configured with -DUNSEEN_WITH_CGAL=OFF it "
           "is\n"
           "under the MIT licence, beside those of the libraries that it links.";
}

} // namespace unseen::app
