// Other people's simplification of the same mesh to a tenth of its triangles, beside a budget cut of a tree that is
// there. They begin with the mesh each time, a cut with a tree: what a view-dependent frame would take with either.
#include <benchmark/benchmark.h>

#include <vector>

#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/cut.h>

#include "bench_mesh.h"

#ifdef UNSEEN_BENCH_WITH_MESHOPTIMIZER
#include <meshoptimizer.h>
#endif
#ifdef UNSEEN_BENCH_WITH_OPENMESH
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Tools/Decimater/DecimaterT.hh>
#include <OpenMesh/Tools/Decimater/ModQuadricT.hh>
#endif
#ifdef UNSEEN_BENCH_WITH_CGAL
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Count_ratio_stop_predicate.h>
#include <CGAL/Surface_mesh_simplification/edge_collapse.h>
#include <CGAL/version.h>
#endif

namespace unseen::bench {
namespace {

constexpr std::size_t one_in = 10; // triangles that stay

std::size_t wanted_triangles() { return mesh().triangles.size() / one_in; }

void report(benchmark::State& state, std::size_t left) {
    state.counters["triangles"] = static_cast<double>(left);
    state.counters["input/s"] =
        benchmark::Counter(static_cast<double>(mesh().triangles.size()) * static_cast<double>(state.iterations()),
                           benchmark::Counter::kIsRate);
}

void to_a_tenth_unseen(benchmark::State& state) {
    vdtree::Cut cut(tree());
    const vdtree::DistanceCriterion extent = *vdtree::extent_criterion(tree(), orbit(0), 1);
    vdtree::FollowOptions options;
    options.triangle_budget = static_cast<vdtree::Index>(wanted_triangles());
    double degrees = 0;
    for (auto _ : state) {
        benchmark::DoNotOptimize(
            cut.follow(extent, {.eye = vdtree::eye_in_tree(tree(), orbit(degrees += 90), {})}, options));
        benchmark::DoNotOptimize(cut.indices().data());
    }
    report(state, cut.triangle_count());
}
BENCHMARK(to_a_tenth_unseen)->Unit(benchmark::kMillisecond);

#ifdef UNSEEN_BENCH_WITH_MESHOPTIMIZER
void to_a_tenth_meshoptimizer(benchmark::State& state, bool sloppy) {
    std::vector<glm::vec3> positions(mesh().positions.begin(), mesh().positions.end());
    std::vector<unsigned> indices;
    for (const vdtree::Triangle& t : mesh().triangles) indices.insert(indices.end(), t.begin(), t.end());
    std::vector<unsigned> out(indices.size());
    const std::size_t wanted = 3 * wanted_triangles();
    std::size_t left = 0;
    for (auto _ : state) {
        left = sloppy ? meshopt_simplifySloppy(out.data(), indices.data(), indices.size(), &positions[0].x,
                                               positions.size(), sizeof(glm::vec3), wanted, 1.0f)
                      : meshopt_simplify(out.data(), indices.data(), indices.size(), &positions[0].x, positions.size(),
                                         sizeof(glm::vec3), wanted, 1.0f);
        benchmark::DoNotOptimize(out.data());
    }
    report(state, left / 3);
}
BENCHMARK_CAPTURE(to_a_tenth_meshoptimizer, simplify, false)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(to_a_tenth_meshoptimizer, simplify_sloppy, true)->Unit(benchmark::kMillisecond);
#endif

#ifdef UNSEEN_BENCH_WITH_OPENMESH
struct DoubleTraits : OpenMesh::DefaultTraits {
    using Point = OpenMesh::Vec3d;
    using Normal = OpenMesh::Vec3d;
};

void to_a_tenth_openmesh(benchmark::State& state) {
    using HalfedgeMesh = OpenMesh::TriMesh_ArrayKernelT<DoubleTraits>;
    std::size_t left = 0;
    for (auto _ : state) {
        state.PauseTiming();
        HalfedgeMesh half;
        std::vector<HalfedgeMesh::VertexHandle> vertices;
        for (const glm::dvec3& p : mesh().positions) vertices.push_back(half.add_vertex({p.x, p.y, p.z}));
        for (const vdtree::Triangle& t : mesh().triangles)
            half.add_face(vertices[t[0]], vertices[t[1]], vertices[t[2]]);
        state.ResumeTiming();
        OpenMesh::Decimater::DecimaterT<HalfedgeMesh> decimater(half);
        OpenMesh::Decimater::ModQuadricT<HalfedgeMesh>::Handle quadric;
        decimater.add(quadric);
        decimater.module(quadric).unset_max_err();
        decimater.initialize();
        decimater.decimate_to_faces(0, wanted_triangles());
        half.garbage_collection();
        left = half.n_faces();
    }
    report(state, left);
}
BENCHMARK(to_a_tenth_openmesh)->Unit(benchmark::kMillisecond);
#endif

#ifdef UNSEEN_BENCH_WITH_CGAL
void to_a_tenth_cgal(benchmark::State& state) {
    using SurfaceMesh = CGAL::Surface_mesh<CGAL::Simple_cartesian<double>::Point_3>;
    namespace sms = CGAL::Surface_mesh_simplification;
    std::size_t left = 0;
    for (auto _ : state) {
        state.PauseTiming();
        SurfaceMesh surface;
        std::vector<SurfaceMesh::Vertex_index> vertices;
        for (const glm::dvec3& p : mesh().positions) vertices.push_back(surface.add_vertex({p.x, p.y, p.z}));
        for (const vdtree::Triangle& t : mesh().triangles)
            surface.add_face(vertices[t[0]], vertices[t[1]], vertices[t[2]]);
        state.ResumeTiming();
        // Of the edges, which go as the triangles do.
        sms::edge_collapse(surface, sms::Count_ratio_stop_predicate<SurfaceMesh>(1.0 / one_in));
        left = surface.number_of_faces();
    }
    report(state, left);
}
BENCHMARK(to_a_tenth_cgal)->Unit(benchmark::kMillisecond);
#endif

} // namespace
} // namespace unseen::bench
