// The adapter for OpenMesh: meshes to trees, cuts back to meshes, its decimater as a clusterer.
#include <unseen/openmesh/decimater_clusterer.h>
#include <unseen/openmesh/openmesh.h>

#include <OpenMesh/Core/Mesh/PolyMesh_ArrayKernelT.hh>
#include <OpenMesh/Tools/Decimater/ModNormalFlippingT.hh>
#include <OpenMesh/Tools/Decimater/ModRoundnessT.hh>

#include "shapes.h"
#include "testing.h"
#include "triangle_distance.h"

namespace unseen::openmesh {
namespace {

using vdtree::Index;
using vdtree::Mesh;
using vdtree::Triangle;

struct Traits : OpenMesh::DefaultTraits {
    using Point = OpenMesh::Vec3d;
    VertexAttributes(OpenMesh::Attributes::Status);
    FaceAttributes(OpenMesh::Attributes::Status);
    EdgeAttributes(OpenMesh::Attributes::Status);
    HalfedgeAttributes(OpenMesh::Attributes::Status);
};
using TriMesh = OpenMesh::TriMesh_ArrayKernelT<Traits>;
using PolyMesh = OpenMesh::PolyMesh_ArrayKernelT<Traits>;
using FloatMesh = OpenMesh::TriMesh_ArrayKernelT<>;

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

void expect_equal(const Mesh& a, const Mesh& b) {
    EXPECT_EQ(a.positions, b.positions);
    EXPECT_EQ(a.normals, b.normals);
    EXPECT_EQ(a.uvs, b.uvs);
    ASSERT_EQ(a.colours.size(), b.colours.size());
    for (std::size_t v = 0; v < a.colours.size(); ++v)
        for (int k = 0; k < 4; ++k) EXPECT_NEAR(a.colours[v][k], b.colours[v][k], 1e-6) << v; // bytes in between
    ASSERT_EQ(a.triangles.size(), b.triangles.size());
    for (std::size_t t = 0; t < a.triangles.size(); ++t) {
        Triangle x = a.triangles[t], y = b.triangles[t];
        std::rotate(x.begin(), std::min_element(x.begin(), x.end()), x.end());
        std::rotate(y.begin(), std::min_element(y.begin(), y.end()), y.end());
        EXPECT_EQ(x, y) << t; // halfedges begin where they like
    }
}

TEST(OpenMeshAdapter, MeshesGoThereAndBack) {
    for (const Mesh& mesh :
         {with_attributes(shapes::bumpy_sphere(3)), with_attributes(shapes::torus(20, 12)), shapes::cube(2)}) {
        const auto made = require(from_mesh<TriMesh>(mesh.view()));
        EXPECT_EQ(made->loose_triangles, 0u);
        EXPECT_EQ(made->mesh.has_vertex_colors(), !mesh.colours.empty());
        const auto back = require(to_mesh(made->mesh));
        Mesh expected = mesh;
        if (expected.normals.empty()) EXPECT_TRUE(back->mesh.normals.empty());
        expect_equal(back->mesh, expected);
        for (std::size_t v = 0; v < back->vertices.size(); ++v) EXPECT_EQ(back->vertices[v].idx(), static_cast<int>(v));
    }
}

TEST(OpenMeshAdapter, ATreesFullCutIsTheMesh) {
    const Mesh mesh = with_attributes(shapes::torus(24, 16));
    const auto made = require(from_mesh<TriMesh>(mesh.view()));
    const auto tree = require(build_tree(made->mesh, {.prelit = true}));
    ASSERT_TRUE(vdtree::verify(*tree));
    vdtree::Cut cut(*tree);
    cut.unfold_all();
    const auto whole = require(extract_mesh<TriMesh>(cut));
    EXPECT_EQ(whole->mesh.n_faces(), mesh.triangles.size());
    EXPECT_EQ(whole->mesh.n_vertices(), mesh.positions.size());
    EXPECT_EQ(whole->loose_triangles, 0u);
    for (std::size_t v = 0; v < whole->sources.size(); ++v) {
        ASSERT_GE(whole->sources[v], tree->interior_wedge_count());
        const Index source = tree->source_vertices()[whole->sources[v] - tree->interior_wedge_count()];
        const TriMesh::VertexHandle here(static_cast<int>(v)), there(static_cast<int>(source));
        EXPECT_LT((whole->mesh.point(here) - made->mesh.point(there)).norm(), 1e-6);
        EXPECT_EQ(whole->mesh.color(here), made->mesh.color(there));
        EXPECT_EQ(whole->mesh.texcoord2D(here), made->mesh.texcoord2D(there));
        EXPECT_LT((whole->mesh.normal(here) - made->mesh.normal(there)).norm(), 1e-2); // trees pack normals
    }
}

TEST(OpenMeshAdapter, ASmallCutIsAManifoldMeshOrSaysWhatIsLoose) {
    const Mesh mesh = shapes::bumpy_sphere(4);
    const auto tree = require(vdtree::build_tree(mesh.view()));
    vdtree::Cut cut(*tree);
    const auto displacement = [](const vdtree::VertexTree& t, std::span<const vdtree::NodeId> nodes,
                                 std::span<float> costs) {
        for (std::size_t i = 0; i < nodes.size(); ++i) costs[i] = t.displacement()[nodes[i]];
    };
    cut.adjust(displacement, 300);
    const auto small = require(extract_mesh<FloatMesh>(cut));
    EXPECT_EQ(small->mesh.n_faces(), cut.triangle_count()); // none is lost
}

TEST(OpenMeshAdapter, NonManifoldTrianglesKeepVerticesOfTheirOwn) {
    Mesh mesh; // three triangles on one edge
    mesh.positions = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {-1, -1, 0}};
    mesh.triangles = {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}};
    const auto made = require(from_mesh<TriMesh>(mesh.view()));
    EXPECT_EQ(made->loose_triangles, 1u);
    EXPECT_EQ(made->mesh.n_faces(), 3u);
    EXPECT_EQ(made->mesh.n_vertices(), 8u);
    EXPECT_EQ(made->sources, (std::vector<Index>{0, 1, 2, 3, 4, 0, 1, 4}));
    EXPECT_TRUE(omerr().is_enabled());
}

TEST(OpenMeshAdapter, DeletedElementsAreLeftOutWithoutCollectingGarbage) {
    const Mesh mesh = with_attributes(shapes::torus(12, 8));
    auto made = require(from_mesh<TriMesh>(mesh.view()));
    made->mesh.delete_vertex(TriMesh::VertexHandle(5), true);
    const auto soup = require(to_mesh(made->mesh));
    EXPECT_EQ(soup->mesh.triangles.size(), mesh.triangles.size() - 6);
    EXPECT_EQ(soup->mesh.positions.size(), mesh.positions.size() - 1);
    EXPECT_EQ(soup->vertices[5].idx(), 6);
    for (std::size_t t = 0; t < soup->faces.size(); ++t) {
        std::set<int> expected, found;
        for (const auto v : made->mesh.fv_range(soup->faces[t])) expected.insert(v.idx());
        for (const Index v : soup->mesh.triangles[t]) found.insert(soup->vertices[v].idx());
        EXPECT_EQ(found, expected);
    }
    EXPECT_TRUE(build_tree(made->mesh));
}

TEST(OpenMeshAdapter, PolygonsAreNamed) {
    PolyMesh mesh;
    std::vector<PolyMesh::VertexHandle> v;
    for (const auto& p : {PolyMesh::Point(0, 0, 0), PolyMesh::Point(1, 0, 0), PolyMesh::Point(1, 1, 0),
                          PolyMesh::Point(0, 1, 0), PolyMesh::Point(2, 0, 0)})
        v.push_back(mesh.add_vertex(p));
    mesh.add_face(v[1], v[4], v[2]);
    mesh.add_face({v[0], v[1], v[2], v[3]});
    EXPECT_THAT(error_in(to_mesh(mesh)), HasSubstr("Face 1 has 4 corners"));
    mesh.triangulate();
    EXPECT_EQ(require(to_mesh(mesh))->mesh.triangles.size(), 3u);
}

TEST(OpenMeshAdapter, EmptyAndBrokenMeshesAreErrors) {
    EXPECT_FALSE(build_tree(TriMesh()));
    TriMesh mesh;
    const auto a = mesh.add_vertex({0, 0, 0}), b = mesh.add_vertex({1, 0, 0}),
               c = mesh.add_vertex({0, std::numeric_limits<double>::quiet_NaN(), 0});
    mesh.add_face(a, b, c);
    EXPECT_THAT(error_in(build_tree(mesh)), HasSubstr("Vertex 2"));
    PolyMesh null_face;
    null_face.new_face();
    EXPECT_THAT(error_in(to_mesh(null_face)), HasSubstr("Face 0 has no halfedge"));
}

TEST(OpenMeshAdapter, CornersSplitVerticesAtSeams) {
    TriMesh mesh; // two triangles with other texture coordinates on their common edge
    mesh.request_halfedge_texcoords2D();
    const auto a = mesh.add_vertex({0, 0, 0}), b = mesh.add_vertex({1, 0, 0}), c = mesh.add_vertex({0, 1, 0}),
               d = mesh.add_vertex({1, 1, 0});
    const auto lower = mesh.add_face(a, b, c), upper = mesh.add_face(b, d, c);
    for (const auto h : mesh.fh_range(lower)) mesh.set_texcoord2D(h, {0.25f, 0.0f});
    for (const auto h : mesh.fh_range(upper)) mesh.set_texcoord2D(h, {0.75f, 0.0f});
    const auto soup = require(to_mesh(mesh));
    EXPECT_EQ(soup->mesh.positions.size(), 6u); // b and c twice
    EXPECT_EQ(soup->mesh.uvs[soup->mesh.triangles[0][0]].x, 0.25f);
    for (const Index v : soup->mesh.triangles[1]) EXPECT_EQ(soup->mesh.uvs[v].x, 0.75f);
    EXPECT_EQ(soup->vertices[4].idx() + soup->vertices[5].idx(), b.idx() + c.idx());
}

Result<vdtree::VertexTree> decimated_tree(const Mesh& mesh, const vdtree::BuildOptions& options = {}) {
    return vdtree::build_tree(
        mesh.view(), [](const vdtree::ClusterInput& input) { return cluster_by_decimater(input); }, options);
}

Mesh two_spheres() {
    Mesh mesh = shapes::bumpy_sphere(2);
    const Mesh other = shapes::bumpy_sphere(2);
    const auto first = static_cast<Index>(mesh.positions.size());
    for (const glm::dvec3& p : other.positions) mesh.positions.push_back(p + glm::dvec3(5, 0, 0));
    for (const Triangle& t : other.triangles) mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    return mesh;
}

TEST(DecimaterClusterer, MakesSoundTreesOfClosedOpenAndPartedSurfaces) {
    Mesh seamed = shapes::cube(4); // all corners apart
    Mesh soup;
    for (const Triangle& t : seamed.triangles) {
        const auto first = static_cast<Index>(soup.positions.size());
        for (const Index v : t) soup.positions.push_back(seamed.positions[v]);
        soup.triangles.push_back({first, first + 1, first + 2});
    }
    for (const Mesh& mesh :
         {shapes::tetrahedron(), shapes::bumpy_sphere(3), shapes::torus(30, 12), two_spheres(), soup}) {
        const auto tree = require(decimated_tree(mesh));
        const auto sound = vdtree::verify(*tree);
        EXPECT_TRUE(sound) << sound.error().message;
        EXPECT_EQ(tree->triangle_count(), mesh.triangles.size());
    }
}

double mean_distance(const Mesh& original, const Mesh& simple) {
    double sum = 0;
    for (const glm::dvec3& p : original.positions) {
        double nearest = std::numeric_limits<double>::infinity();
        for (const Triangle& t : simple.triangles)
            nearest = std::min(nearest, support::distance_to_triangle(p, simple.positions[t[0]], simple.positions[t[1]],
                                                                      simple.positions[t[2]]));
        sum += nearest;
    }
    return sum / static_cast<double>(original.positions.size());
}

TEST(DecimaterClusterer, StraysLittleFartherThanOurs) {
    const Mesh mesh = shapes::bumpy_sphere(4);
    const auto ours = require(vdtree::build_tree(mesh.view())), theirs = require(decimated_tree(mesh));
    double distance[2] = {};
    const vdtree::VertexTree* trees[] = {&*ours, &*theirs};
    for (int i = 0; i < 2; ++i) {
        vdtree::Cut cut(*trees[i]);
        const auto displacement = [](const vdtree::VertexTree& t, std::span<const vdtree::NodeId> nodes,
                                     std::span<float> costs) {
            for (std::size_t k = 0; k < nodes.size(); ++k) costs[k] = t.displacement()[nodes[k]];
        };
        cut.adjust(displacement, 1000);
        distance[i] = mean_distance(mesh, vdtree::extract_mesh(cut));
    }
    constexpr double most_ratio = 2; // their proxies are vertices of the mesh
    EXPECT_LE(distance[1], most_ratio * distance[0]);
    EXPECT_GT(distance[1], 0);
}

TEST(DecimaterClusterer, TakesAnyModules) {
    const Mesh mesh = shapes::bumpy_sphere(3);
    std::size_t limited = 0;
    const auto tree = vdtree::build_tree(mesh.view(), [&](const vdtree::ClusterInput& input) {
        return cluster_by_decimater(input, [&](ClusterDecimater& decimater) {
            OpenMesh::Decimater::ModQuadricT<ClusterMesh>::Handle quadric;
            OpenMesh::Decimater::ModNormalFlippingT<ClusterMesh>::Handle flipping;
            decimater.add(quadric);
            decimater.add(flipping);
            decimater.module(quadric).set_max_err(1e-6, false); // leaves much to our clusterer
            ++limited;
        });
    });
    ASSERT_TRUE(tree) << tree.error().message;
    EXPECT_EQ(limited, 1u);
    EXPECT_TRUE(vdtree::verify(*tree));
}

TEST(DecimaterClusterer, RefusesTwoPriorities) {
    const auto tree = vdtree::build_tree(shapes::bumpy_sphere(2).view(), [](const vdtree::ClusterInput& input) {
        return cluster_by_decimater(input, [](ClusterDecimater& decimater) {
            OpenMesh::Decimater::ModQuadricT<ClusterMesh>::Handle quadric;
            OpenMesh::Decimater::ModRoundnessT<ClusterMesh>::Handle roundness;
            decimater.add(quadric);
            decimater.add(roundness);
            decimater.module(quadric).set_binary(false);
            decimater.module(roundness).set_binary(false);
        });
    });
    ASSERT_FALSE(tree);
    EXPECT_THAT(tree.error().message, HasSubstr("exactly one module"));
}

TEST(DecimaterClusterer, RefusesWhatIsNotManifold) {
    Mesh mesh = shapes::bumpy_sphere(2);
    mesh.positions.emplace_back(3, 0, 0);
    mesh.triangles.push_back(
        {mesh.triangles[0][0], mesh.triangles[0][1], static_cast<Index>(mesh.positions.size() - 1)});
    const auto tree = decimated_tree(mesh);
    ASSERT_FALSE(tree);
    EXPECT_EQ(tree.error().code, ErrorCode::unsupported);
    EXPECT_THAT(tree.error().message, HasSubstr("1 of 321 triangles"));
    EXPECT_THAT(tree.error().message, HasSubstr("quadric"));
}

TEST(DecimaterClusterer, CanBeCancelled) {
    const auto tree = vdtree::build_tree(shapes::bumpy_sphere(3).view(), [](const vdtree::ClusterInput& input) {
        return cluster_by_decimater(input, [](double share, const char*) { return share < 0.5; });
    });
    ASSERT_FALSE(tree);
    EXPECT_EQ(tree.error().code, ErrorCode::cancelled);
}

TEST(DecimaterClusterer, DoesNotDependOnTheSize) {
    Mesh tiny = shapes::bumpy_sphere(3), usual = tiny;
    for (glm::dvec3& p : tiny.positions) p *= 0x1p-60;
    const auto a = require(decimated_tree(usual)), b = require(decimated_tree(tiny));
    const auto x = a->source_vertices(), y = b->source_vertices();
    EXPECT_TRUE(std::equal(x.begin(), x.end(), y.begin(), y.end()));
}

} // namespace
} // namespace unseen::openmesh
