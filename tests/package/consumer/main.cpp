// What a first program with Unseen looks like: a tetrahedron, folded as far as nobody can see it.
#include <cstdio>

#include <unseen/calibration/calibration.h>
#include <unseen/perception/perception.h>
#include <unseen/vdtree/vdtree.h>
#ifdef WITH_RENDER
#include <unseen/render/render.h>
#endif
#ifdef WITH_SESSION
#include <unseen/session/session.h>
#endif
#ifdef WITH_OPENMESH
#include <unseen/openmesh/openmesh.h>
#endif
#ifdef WITH_CGAL
#include <CGAL/Simple_cartesian.h>
#include <unseen/cgal/cgal.h>
#include <unseen/exact/exact.h>
#include <unseen/repair/repair.h>
#endif
#if defined(WITH_RENDER) && defined(WITH_SESSION)
#include <unseen/session_gpu/session_gpu.h>
#endif

int main() {
    using namespace unseen;
    const std::vector<glm::dvec3> positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const std::vector<vdtree::Triangle> triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
    const auto tree = vdtree::build_tree({positions, triangles});
    if (!tree) return std::printf("%s\n", tree.error().message.c_str()), 1;

    vdtree::View view;
    view.eye = {0, 0, 2000};
    perception::FoldTestOptions options;
    view.fov_y_degrees = physical_field(options.display, view.height).value();
    vdtree::Cut cut(*tree);
    cut.unfold_all();
    if (cut.triangle_count() != 4) return std::printf("the tetrahedron lost a face\n"), 1;
    const auto criterion = perception::luebke_hallen_distances(*tree, view, options);
    if (!criterion) return std::printf("%s\n", criterion.error().message.c_str()), 1;
    const auto stats = cut.follow(*criterion, perception::viewpoint_of(*tree, view, options, {}, false));
    if (!stats) return std::printf("%s\n", stats.error().message.c_str()), 1;
    const auto plan = calibration::plan_for(options.display, perception::CsfTable::standard());
    if (plan.places.empty()) return std::printf("nothing to calibrate on the default display\n"), 1;
    std::printf("%u of %u triangles, largest fold cost %g\n", stats->triangles, tree->triangle_count(),
                static_cast<double>(stats->max_fold_cost));
#ifdef WITH_SESSION
    auto session = session::Session::create(session::Scene::of(*vdtree::build_tree({positions, triangles})));
    if (!session) return std::printf("%s\n", session.error().message.c_str()), 1;
    const auto whole = session->simplify({.goal = session::Goal::full()});
    if (!whole || whole->mesh().triangles.size() != 4) return std::printf("the session lost a face\n"), 1;
#endif
#ifdef WITH_OPENMESH
    cut.unfold_all();
    const auto half = openmesh::extract_mesh<OpenMesh::TriMesh_ArrayKernelT<>>(cut);
    if (!half || half->mesh.n_faces() != 4 || !openmesh::build_tree(half->mesh))
        return std::printf("OpenMesh lost a face\n"), 1;
#endif
#ifdef WITH_CGAL
    cut.unfold_all();
    const auto surface = cgal::extract_mesh<CGAL::Surface_mesh<CGAL::Simple_cartesian<double>::Point_3>>(cut);
    if (!surface || surface->mesh.number_of_faces() != 4 || !cgal::build_tree(surface->mesh))
        return std::printf("CGAL lost a face\n"), 1;
    const auto repaired = repair::repair(vdtree::extract_mesh(cut));
    if (!repaired || repaired->mesh.triangles.size() != 4) return std::printf("the repair lost a face\n"), 1;
    if (!exact::verify_exactly(*tree)) return std::printf("the tetrahedron's bounds are wrong\n"), 1;
#endif
#if defined(WITH_RENDER) && defined(WITH_SESSION)
    if (session::drawn_cuts({&cut, 1}).size() != 1) return std::printf("the cut is not drawn\n"), 1;
#endif
#ifdef WITH_RENDER
    return render::n_rooks(16, 1).size() == 16 ? 0 : 1;
#endif
}
