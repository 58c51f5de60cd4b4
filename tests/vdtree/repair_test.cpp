// Soups made fit for trees: orientation, cracks, holes.
#include <unseen/repair/repair.h>

#include <unseen/meshio/examine.h>
#include <unseen/vdtree/builder.h>

#include "shapes.h"
#include "testing.h"

namespace unseen::repair {
namespace {

using vdtree::Closedness;
using vdtree::Index;
using vdtree::Mesh;
using vdtree::Triangle;

Closedness closedness(const Mesh& mesh) {
    const auto tree = vdtree::build_tree(mesh.view());
    EXPECT_TRUE(tree) << tree.error().message;
    return tree ? tree->closedness() : Closedness::open;
}

meshio::Examination examined(const Mesh& mesh) { return *meshio::examine(mesh.view()); }

Mesh with_turned_triangles(Mesh mesh, int one_in) {
    for (std::size_t t = 0; t < mesh.triangles.size(); t += static_cast<std::size_t>(one_in))
        std::swap(mesh.triangles[t][0], mesh.triangles[t][1]);
    return mesh;
}

TEST(Repair, LeavesSoundMeshesAlone) {
    for (const Mesh& mesh :
         {shapes::bumpy_sphere(3), shapes::with_attributes(shapes::torus(20, 12)), shapes::grid(5)}) {
        const auto repaired = require(repair(mesh));
        EXPECT_EQ(repaired->mesh.positions, mesh.positions);
        EXPECT_EQ(repaired->mesh.triangles, mesh.triangles);
        EXPECT_EQ(repaired->mesh.normals, mesh.normals);
        EXPECT_EQ(repaired->mesh.uvs, mesh.uvs);
        EXPECT_EQ(repaired->report.turned_triangles, 0u);
        EXPECT_EQ(repaired->report.moved_vertices, 0u);
    }
}

TEST(Repair, GivesPartsOneOrientation) {
    const Mesh sphere = shapes::bumpy_sphere(3);
    const Mesh mixed = with_turned_triangles(sphere, 3);
    ASSERT_EQ(closedness(mixed), Closedness::open);
    const auto repaired = require(repair(mixed));
    EXPECT_EQ(closedness(repaired->mesh), Closedness::closed_outward);
    EXPECT_EQ(repaired->report.turned_triangles, (sphere.triangles.size() + 2) / 3);
    EXPECT_EQ(repaired->report.cap_triangles, 0u);
}

TEST(Repair, AnOpenPartKeepsTheDirectionOfMost) {
    const Mesh sheet = shapes::grid(6);
    const auto repaired = require(repair(with_turned_triangles(sheet, 4), {.largest_hole = 0}));
    EXPECT_EQ(examined(repaired->mesh).inconsistent_edges, 0u);
    EXPECT_EQ(repaired->report.turned_triangles, (sheet.triangles.size() + 3) / 4);
}

TEST(Repair, ClosedPartsFaceOutwardButForCavities) {
    const auto turned = require(repair(shapes::inside_out(shapes::unwelded(shapes::cube(3)))));
    EXPECT_EQ(closedness(turned->mesh), Closedness::closed_outward);
    const Mesh outer = shapes::icosphere(2), inner = shapes::placed(shapes::icosphere(2), 0.25);
    const auto hollow = require(repair(shapes::together(shapes::inside_out(outer), shapes::inside_out(inner))));
    EXPECT_EQ(hollow->report.turned_triangles, outer.triangles.size());
    EXPECT_EQ(examined(hollow->mesh).inside_out_components, 1u);
    EXPECT_EQ(require(repair(shapes::together(outer, inner)))->report.turned_triangles, 0u);
}

TEST(Repair, TurnsNormalsThatPointIntoTheSurfaceThen) {
    Mesh mesh = shapes::inside_out(shapes::icosphere(2));
    for (const glm::dvec3& p : mesh.positions) mesh.normals.emplace_back(-glm::normalize(p));
    const auto repaired = require(repair(mesh));
    for (std::size_t v = 0; v < mesh.positions.size(); ++v)
        EXPECT_GT(glm::dot(glm::dvec3(repaired->mesh.normals[v]), mesh.positions[v]), 0);
}

// Without the triangles around a vertex.
Mesh with_hole(const Mesh& whole, Index vertex) {
    Mesh mesh = whole;
    std::erase_if(mesh.triangles, [&](const Triangle& t) { return std::set(t.begin(), t.end()).contains(vertex); });
    return mesh;
}

TEST(Repair, CapsSmallHolesInTheMaterialBesideThem) {
    const Mesh whole = shapes::with_attributes(shapes::bumpy_sphere(4));
    Mesh mesh = with_hole(whole, 100);
    const std::uint64_t half = mesh.triangles.size() / 2;
    mesh.ranges = {{"first", vdtree::MeshRange::Kind::material, 0, half},
                   {"second", vdtree::MeshRange::Kind::material, half, mesh.triangles.size() - half}};
    ASSERT_EQ(closedness(mesh), Closedness::open);
    const auto repaired = require(repair(mesh));
    EXPECT_EQ(repaired->report.holes, 1u);
    EXPECT_EQ(repaired->report.capped_holes, 1u);
    EXPECT_EQ(repaired->report.cap_triangles, 4u); // of a hexagon
    EXPECT_EQ(closedness(repaired->mesh), Closedness::closed_outward);
    EXPECT_EQ(repaired->mesh.positions, mesh.positions);
    const auto& ranges = repaired->mesh.ranges;
    EXPECT_EQ(ranges[0].triangle_count + ranges[1].triangle_count, repaired->mesh.triangles.size());
    EXPECT_EQ(ranges[1].first_triangle, ranges[0].triangle_count);
    ASSERT_TRUE(vdtree::validate(repaired->mesh.view()));

    const auto large_stay = require(repair(mesh, {.largest_hole = 0.01}));
    EXPECT_EQ(large_stay->report.capped_holes, 0u);
    EXPECT_EQ(large_stay->mesh.triangles, mesh.triangles);
    EXPECT_EQ(repair(mesh, {.largest_hole = 0})->mesh.triangles, mesh.triangles);
}

TEST(Repair, GivesSheetsNoBacks) {
    const Mesh leaves = shapes::together(shapes::single_triangle(), shapes::placed(shapes::grid(4), 0.01, {50, 0, 0}));
    const auto repaired = require(repair(leaves));
    EXPECT_EQ(repaired->report.holes, 2u);
    EXPECT_EQ(repaired->mesh.triangles, leaves.triangles);
}

TEST(Repair, CapsNoBordersThatNonManifoldEdgesHaveMade) {
    // A leaf of one triangle on an edge of a sphere, and another one on all three corners of a triangle of it.
    Mesh mesh = shapes::bumpy_sphere(3);
    const Triangle t = mesh.triangles[0];
    mesh.positions.emplace_back(mesh.positions[t[0]] * 1.05);
    mesh.triangles.push_back({t[0], t[1], static_cast<Index>(mesh.positions.size() - 1)});
    mesh.triangles.push_back({t[0], t[2], t[1]});
    const auto repaired = require(repair(mesh));
    EXPECT_EQ(repaired->report.cap_triangles, 0u);
    EXPECT_EQ(repaired->mesh.triangles.size(), mesh.triangles.size());
}

TEST(Repair, ClosesCracksWithinTheGap) {
    Mesh mesh = shapes::unwelded(shapes::bumpy_sphere(3)); // each corner a little elsewhere
    std::mt19937_64 random(5);
    for (glm::dvec3& p : mesh.positions) p += 1e-8 * shapes::random_direction(random);
    ASSERT_EQ(closedness(mesh), Closedness::open);
    const auto repaired = require(repair(mesh));
    EXPECT_GT(repaired->report.moved_vertices, 0u);
    EXPECT_EQ(closedness(repaired->mesh), Closedness::closed_outward);
    const auto too_wide = require(repair(mesh, {.gap = 1e-13, .largest_hole = 0}));
    EXPECT_EQ(too_wide->report.moved_vertices, 0u);
    EXPECT_EQ(closedness(too_wide->mesh), Closedness::open);
}

TEST(Repair, LeavesOutDuplicatesButNotTheOtherSide) {
    Mesh mesh = shapes::grid(3);
    const std::size_t count = mesh.triangles.size();
    const Triangle t = mesh.triangles[4];
    mesh.triangles.push_back({t[1], t[2], t[0]}); // the same
    mesh.triangles.push_back({t[1], t[0], t[2]}); // its back
    const auto repaired = require(repair(mesh, {.largest_hole = 0}));
    EXPECT_EQ(repaired->report.duplicates, 1u);
    EXPECT_EQ(repaired->mesh.triangles.size(), count + 1);
}

TEST(Repair, TakesAnySoupAndLosesNoTriangle) {
    for (const shapes::Named& shape : shapes::all()) {
        const auto repaired = require(repair(shape.mesh));
        std::size_t usable = 0;
        for (const Triangle& t : shape.mesh.triangles) usable += t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
        EXPECT_EQ(repaired->mesh.triangles.size() + repaired->report.duplicates,
                  usable + repaired->report.cap_triangles)
            << shape.name;
        EXPECT_EQ(repaired->mesh.positions.size(), shape.mesh.positions.size()) << shape.name;
        EXPECT_LE(examined(repaired->mesh).inconsistent_edges, examined(shape.mesh).inconsistent_edges) << shape.name;
        const auto again = require(repair(repaired->mesh));
        if (shape.name != "random_soup") { // where CGAL cuts non-manifold edges depends on the directions
            EXPECT_EQ(again->report.turned_triangles, 0u) << shape.name;
        }
    }
}

TEST(Repair, BadInputIsAnError) {
    Mesh mesh = shapes::tetrahedron();
    mesh.positions[2].y = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THAT(error_in(repair(mesh)), HasSubstr("Vertex 2"));
    const double bad = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(repair(shapes::tetrahedron(), {.gap = bad}));
    EXPECT_FALSE(repair(shapes::tetrahedron(), {.gap = 0.5}));
    EXPECT_FALSE(repair(shapes::tetrahedron(), {.largest_hole = bad}));
    EXPECT_FALSE(repair(shapes::tetrahedron(), {.largest_hole = -1}));
    EXPECT_TRUE(repair(Mesh()));
}

} // namespace
} // namespace unseen::repair
