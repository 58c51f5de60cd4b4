// The adapter for CGAL's surface meshes: to trees, and back from cuts.
#include <unseen/cgal/cgal.h>

#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/Simple_cartesian.h>

#include "shapes.h"
#include "testing.h"

namespace unseen::cgal {
namespace {

using vdtree::Index;
using vdtree::Mesh;
using vdtree::Triangle;

using Kernel = CGAL::Simple_cartesian<double>;
using Surface = CGAL::Surface_mesh<Kernel::Point_3>;
using Exact = CGAL::Exact_predicates_exact_constructions_kernel;
using ExactSurface = CGAL::Surface_mesh<Exact::Point_3>;

Mesh with_attributes(Mesh mesh) {
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
        const float share = static_cast<float>(v) / static_cast<float>(mesh.positions.size());
        mesh.normals.push_back(glm::normalize(glm::vec3(share, 1, 0.25f)));
        const auto byte = [](std::size_t value) { return srgb_to_linear(static_cast<float>(value % 256) / 255.0f); };
        mesh.colours.emplace_back(byte(v), byte(7 * v), byte(31 * v), 1);
        mesh.uvs.emplace_back(share, 1 - share);
    }
    return mesh;
}

Triangle from_least(Triangle t) {
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    return t;
}

template <class M>
void expect_round_trip(const Mesh& mesh) {
    const auto made = require(from_mesh<M>(mesh.view()));
    EXPECT_EQ(made->loose_triangles, 0u);
    const auto back = require(to_mesh(made->mesh));
    EXPECT_EQ(back->mesh.positions, mesh.positions);
    EXPECT_EQ(back->mesh.normals, mesh.normals);
    EXPECT_EQ(back->mesh.uvs, mesh.uvs);
    ASSERT_EQ(back->mesh.colours.size(), mesh.colours.size());
    for (std::size_t v = 0; v < mesh.colours.size(); ++v)
        for (int k = 0; k < 4; ++k) EXPECT_NEAR(back->mesh.colours[v][k], mesh.colours[v][k], 1e-6); // bytes in between
    ASSERT_EQ(back->mesh.triangles.size(), mesh.triangles.size());
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
        EXPECT_EQ(from_least(back->mesh.triangles[t]), from_least(mesh.triangles[t]));
}

TEST(CgalAdapter, MeshesGoThereAndBack) {
    expect_round_trip<Surface>(with_attributes(shapes::bumpy_sphere(3)));
    expect_round_trip<Surface>(with_attributes(shapes::torus(20, 12)));
    expect_round_trip<Surface>(shapes::cube(2));
    expect_round_trip<ExactSurface>(with_attributes(shapes::bumpy_sphere(1)));
}

TEST(CgalAdapter, ATreesFullCutIsTheMesh) {
    const Mesh mesh = with_attributes(shapes::torus(24, 16));
    const auto made = require(from_mesh<Surface>(mesh.view()));
    const auto tree = require(build_tree(made->mesh, {.prelit = true}));
    ASSERT_TRUE(vdtree::verify(*tree));
    vdtree::Cut cut(*tree);
    cut.unfold_all();
    const auto whole = require(extract_mesh<Surface>(cut));
    EXPECT_EQ(whole->mesh.number_of_faces(), mesh.triangles.size());
    EXPECT_EQ(whole->mesh.number_of_vertices(), mesh.positions.size());
    EXPECT_TRUE(whole->mesh.is_valid());
    const auto here = whole->mesh.property_map<Surface::Vertex_index, CGAL::IO::Color>("v:color");
    const auto there = made->mesh.property_map<Surface::Vertex_index, CGAL::IO::Color>("v:color");
    ASSERT_TRUE(here.second && there.second);
    for (const auto v : whole->mesh.vertices()) {
        const Index source = tree->source_vertices()[whole->sources[v] - tree->interior_wedge_count()];
        EXPECT_LT(CGAL::squared_distance(whole->mesh.point(v), made->mesh.point(Surface::Vertex_index(source))), 1e-12);
        EXPECT_EQ(here.first[v], there.first[Surface::Vertex_index(source)]);
    }
}

TEST(CgalAdapter, NonManifoldTrianglesKeepVerticesOfTheirOwn) {
    Mesh mesh;
    mesh.positions = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {-1, -1, 0}};
    mesh.triangles = {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}};
    const auto made = require(from_mesh<Surface>(mesh.view()));
    EXPECT_EQ(made->loose_triangles, 1u);
    EXPECT_EQ(made->mesh.number_of_faces(), 3u);
    EXPECT_EQ(made->sources, (std::vector<Index>{0, 1, 2, 3, 4, 0, 1, 4}));
    EXPECT_TRUE(made->mesh.is_valid());
}

TEST(CgalAdapter, RemovedElementsAreLeftOutWithoutCollectingGarbage) {
    auto made = require(from_mesh<Surface>(with_attributes(shapes::torus(12, 8)).view()));
    Surface& mesh = made->mesh;
    const auto faces = mesh.number_of_faces();
    CGAL::Euler::remove_center_vertex(mesh.halfedge(Surface::Vertex_index(5)), mesh); // leaves a hexagon
    auto soup = to_mesh(mesh);
    ASSERT_FALSE(soup);
    EXPECT_THAT(soup.error().message, HasSubstr("has 6 corners"));
    for (const auto f : mesh.faces())
        if (mesh.degree(f) == 6) {
            CGAL::Euler::remove_face(mesh.halfedge(f), mesh);
            break;
        }
    ASSERT_TRUE(mesh.has_garbage());
    soup = to_mesh(mesh);
    ASSERT_TRUE(soup) << soup.error().message;
    EXPECT_EQ(soup->mesh.triangles.size(), faces - 6);
    EXPECT_EQ(soup->vertices[5], Surface::Vertex_index(6));
    EXPECT_TRUE(build_tree(mesh));
}

TEST(CgalAdapter, NullHandlesAreNamed) {
    Surface mesh;
    const auto a = mesh.add_vertex({0, 0, 0}), b = mesh.add_vertex({1, 0, 0}), c = mesh.add_vertex({0, 1, 0});
    const auto face = mesh.add_face(a, b, c);
    mesh.set_halfedge(face, Surface::null_halfedge());
    auto soup = to_mesh(mesh);
    ASSERT_FALSE(soup);
    EXPECT_THAT(soup.error().message, HasSubstr("Face 0 has a halfedge that is null"));
    const Surface::Halfedge_index h = mesh.halfedge(a);
    mesh.set_halfedge(face, mesh.face(h) == face ? h : mesh.opposite(h));
    ASSERT_TRUE(to_mesh(mesh));
    mesh.set_target(mesh.halfedge(face), Surface::null_vertex());
    soup = to_mesh(mesh);
    ASSERT_FALSE(soup);
    EXPECT_THAT(soup.error().message, HasSubstr("Face 0 has a vertex that is null"));
}

TEST(CgalAdapter, EmptyMeshesAndNanAreErrors) {
    EXPECT_FALSE(build_tree(Surface()));
    Surface mesh;
    const auto a = mesh.add_vertex({0, 0, 0}), b = mesh.add_vertex({1, 0, 0}),
               c = mesh.add_vertex({0, std::numeric_limits<double>::quiet_NaN(), 0});
    mesh.add_face(a, b, c);
    EXPECT_FALSE(build_tree(mesh));
}

TEST(CgalAdapter, CornersSplitVerticesAtSeams) {
    Surface mesh;
    const auto a = mesh.add_vertex({0, 0, 0}), b = mesh.add_vertex({1, 0, 0}), c = mesh.add_vertex({0, 1, 0}),
               d = mesh.add_vertex({1, 1, 0});
    const auto lower = mesh.add_face(a, b, c), upper = mesh.add_face(b, d, c);
    auto uvs = mesh.add_property_map<Surface::Halfedge_index, Kernel::Point_2>("h:uv").first;
    for (const auto h : mesh.halfedges_around_face(mesh.halfedge(lower))) uvs[h] = {0.25, 0};
    for (const auto h : mesh.halfedges_around_face(mesh.halfedge(upper))) uvs[h] = {0.75, 0};
    const auto soup = require(to_mesh(mesh));
    EXPECT_EQ(soup->mesh.positions.size(), 6u); // b and c twice
    for (const Index v : soup->mesh.triangles[0]) EXPECT_EQ(soup->mesh.uvs[v].x, 0.25f);
    for (const Index v : soup->mesh.triangles[1]) EXPECT_EQ(soup->mesh.uvs[v].x, 0.75f);
}

} // namespace
} // namespace unseen::cgal
