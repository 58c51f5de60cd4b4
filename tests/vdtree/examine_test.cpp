// Meshes of which everything is known, and what the examination says of them.
#include <unseen/meshio/examine.h>

#include "shapes.h"
#include "testing.h"

namespace unseen::vdtree::examine_test {

using meshio::Examination;

Examination examined(const Mesh& mesh) {
    const Result<Examination> result = meshio::examine(mesh.view());
    EXPECT_TRUE(result) << result.error().message;
    return result ? *result : Examination{};
}

// Of the edges and triangles; all else is compared where it is not 0.
void expect_sound_surface(const Examination& e) {
    EXPECT_EQ(e.degenerate_triangles, 0u);
    EXPECT_EQ(e.duplicate_triangles, 0u);
    EXPECT_EQ(e.non_manifold_edges, 0u);
    EXPECT_EQ(e.non_manifold_vertices, 0u);
    EXPECT_EQ(e.inconsistent_edges, 0u);
}

TEST(Examine, ClosedMeshesHaveNothingUnusual) {
    for (const Mesh& mesh : {shapes::tetrahedron(), shapes::cube(3), shapes::icosphere(2), shapes::torus(12, 8)}) {
        const Examination e = examined(mesh);
        expect_sound_surface(e);
        EXPECT_EQ(e.boundary_edges, 0u);
        EXPECT_EQ(e.boundary_loops, 0u);
        EXPECT_EQ(e.components, 1u);
        EXPECT_EQ(e.closed_components, 1u);
        EXPECT_EQ(e.inside_out_components, 0u);
        EXPECT_EQ(e.unreferenced_vertices, 0u);
        EXPECT_FALSE(e.is_unwelded);
    }
}

TEST(Examine, CountsBoundaryEdgesAndLoops) {
    const Examination sheet = examined(shapes::grid(5));
    expect_sound_surface(sheet);
    EXPECT_EQ(sheet.boundary_edges, 20u);
    EXPECT_EQ(sheet.boundary_loops, 1u);
    EXPECT_EQ(sheet.components, 1u);
    EXPECT_EQ(sheet.closed_components, 0u);
    Mesh holes = shapes::icosphere(2); // two triangles that share no vertex
    holes.triangles.erase(holes.triangles.begin() + 200);
    holes.triangles.erase(holes.triangles.begin());
    EXPECT_EQ(examined(holes).boundary_edges, 6u);
    EXPECT_EQ(examined(holes).boundary_loops, 2u);
}

TEST(Examine, AThirdTriangleMakesAnEdgeNonManifold) {
    const Examination e = examined(shapes::non_manifold_fan(3));
    EXPECT_EQ(e.non_manifold_edges, 1u);
    EXPECT_EQ(e.boundary_edges, 6u);
    EXPECT_EQ(e.components, 1u);
    EXPECT_EQ(e.inconsistent_edges, 0u);
    EXPECT_EQ(e.non_manifold_vertices, 0u); // connected by the edge
}

TEST(Examine, PartsThatTouchInAPointAreNonManifoldThere) {
    Mesh bow_tie;
    bow_tie.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {-1, 0, 0}, {-1, -1, 0}};
    bow_tie.triangles = {{0, 1, 2}, {0, 3, 4}};
    const Examination e = examined(bow_tie);
    EXPECT_EQ(e.non_manifold_vertices, 1u);
    EXPECT_EQ(e.components, 2u);
    EXPECT_EQ(e.boundary_edges, 6u);
    EXPECT_EQ(e.boundary_loops, 1u); // they touch
}

TEST(Examine, AFlippedTriangleHasInconsistentEdges) {
    Mesh mesh = shapes::tetrahedron();
    std::swap(mesh.triangles[2][0], mesh.triangles[2][1]);
    const Examination e = examined(mesh);
    EXPECT_EQ(e.inconsistent_edges, 3u);
    EXPECT_EQ(e.closed_components, 0u);
    EXPECT_EQ(e.boundary_edges, 0u);
    EXPECT_EQ(examined(shapes::moebius_strip(30)).inconsistent_edges, 1u);
}

TEST(Examine, PartsAreInsideOutOneByOne) {
    EXPECT_EQ(examined(shapes::inside_out(shapes::torus(12, 8))).inside_out_components, 1u);
    // The small one is outweighed, and both lie far from the origin.
    const Mesh both = shapes::together(shapes::icosphere(2), shapes::inside_out(shapes::placed(shapes::cube(1), 0.1)));
    for (const Mesh& mesh :
         {both, shapes::placed(both, 1, {5e5, 5e6, 120}), shapes::placed(both, 1e-19), shapes::placed(both, 1e300)}) {
        const Examination e = examined(mesh);
        EXPECT_EQ(e.components, 2u);
        EXPECT_EQ(e.closed_components, 2u);
        EXPECT_EQ(e.inside_out_components, 1u);
        EXPECT_EQ(e.degenerate_triangles, 0u);
    }
}

TEST(Examine, CountsDegenerateAndDuplicateTriangles) {
    EXPECT_EQ(examined(shapes::with_zero_areas()).degenerate_triangles, 4u);
    const Mesh cube = shapes::cube(2);
    EXPECT_EQ(examined(shapes::with_degenerate_triangles(cube)).degenerate_triangles, (cube.triangles.size() + 2) / 3);
    EXPECT_EQ(examined(shapes::with_degenerate_triangles(cube)).closed_components, 1u); // they have no edges
    Mesh twice = cube;
    const Triangle& t = cube.triangles[5];
    twice.triangles.push_back({t[1], t[2], t[0]});
    twice.triangles.push_back({t[1], t[0], t[2]});
    const Examination e = examined(twice);
    EXPECT_EQ(e.duplicate_triangles, 2u);
    EXPECT_EQ(e.non_manifold_edges, 3u);
    EXPECT_EQ(examined(shapes::all_coincident(6)).degenerate_triangles, 6u);
    EXPECT_EQ(examined(shapes::all_coincident(6)).duplicate_triangles, 0u);
    EXPECT_EQ(examined(shapes::all_coincident(6)).components, 0u);
}

TEST(Examine, TellsSeamsFromDuplicates) {
    const Examination seam = examined(shapes::seam(true));
    EXPECT_EQ(seam.coincident_vertices, 2u);
    EXPECT_EQ(seam.duplicate_vertices, 0u);
    EXPECT_EQ(seam.boundary_edges, 6u); // the seam is none
    EXPECT_EQ(seam.components, 1u);
    EXPECT_EQ(examined(shapes::seam(false)).duplicate_vertices, 2u);
    Mesh nan = shapes::seam(false); // equal by their bits, however many there are
    nan.normals.assign(8, glm::vec3(std::numeric_limits<float>::quiet_NaN()));
    EXPECT_EQ(examined(nan).duplicate_vertices, 2u);
}

TEST(Examine, SeesThroughUnweldedMeshes) {
    const Mesh welded = shapes::icosphere(2);
    const Examination e = examined(shapes::unwelded(welded));
    EXPECT_TRUE(e.is_unwelded);
    EXPECT_EQ(e.duplicate_vertices, 3 * welded.triangles.size() - welded.positions.size());
    EXPECT_EQ(e.closed_components, 1u);
    EXPECT_EQ(e.boundary_edges, 0u);
    EXPECT_FALSE(examined(shapes::single_triangle()).is_unwelded);
}

TEST(Examine, UnreferencedVerticesCountForNothingElse) {
    Mesh mesh = shapes::with_unreferenced(shapes::cube(1), 3);
    mesh.positions.front() = {1000, 1000, 1000};
    mesh.positions.back() = mesh.positions[mesh.triangles[0][0]];
    const Examination e = examined(mesh);
    const Examination cube = examined(shapes::cube(1));
    EXPECT_EQ(e.unreferenced_vertices, 9u);
    EXPECT_EQ(e.coincident_vertices, 0u);
    EXPECT_EQ(e.low, cube.low);
    EXPECT_EQ(e.high, cube.high);
}

TEST(Examine, TakesAnyMeshThatIsValid) {
    for (const auto& [name, mesh] : shapes::all()) {
        SCOPED_TRACE(name);
        const Examination e = examined(mesh);
        EXPECT_LE(e.closed_components, e.components);
        EXPECT_LE(e.inside_out_components, e.closed_components);
        EXPECT_LE(e.boundary_loops, e.boundary_edges);
        EXPECT_LE(e.duplicate_vertices, e.coincident_vertices);
    }
    Mesh bad = shapes::tetrahedron();
    bad.triangles[1][1] = 99;
    EXPECT_FALSE(meshio::examine(bad.view()));
    Mesh none;
    EXPECT_EQ(examined(none).components, 0u);
}

} // namespace unseen::vdtree::examine_test
