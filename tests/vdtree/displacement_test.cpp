// How far surfaces move when nodes fold: the tree's bound against distances that were measured.
#include <unseen/vdtree/builder.h>

#include <iostream>
#include <numbers>

#include <unseen/meshio/mesh_file.h>
#include <unseen/vdtree/cut.h>

#include "built.h"
#include "extra_meshes.h"
#include "shapes.h"
#include "sound.h"
#include "surface_distance.h"
#include "temp_folder.h"
#include "testing.h"

namespace unseen::vdtree {
namespace {

// Folds all nodes whose displacement is at most this one, but for triangles that would be turned over: in a plane these
// may cover what the surface does not.
Cut cut_by(const VertexTree& tree, double displacement) {
    Cut cut(tree);
    cut.adjust([&](const VertexTree& t, std::span<const NodeId> nodes, std::span<float> costs) {
        for (std::size_t i = 0; i < nodes.size(); ++i)
            costs[i] = static_cast<float>(static_cast<double>(t.displacement()[nodes[i]]) / displacement);
    });
    return cut;
}

// The triangles over the tree's wedges; in cuts also those that have become lines and points.
Mesh surface_of(const VertexTree& tree, const Cut* cut) {
    Mesh mesh;
    for (const glm::vec3& p : tree.positions()) mesh.positions.emplace_back(p);
    for (Triangle t : support::sound(tree).triangles()) {
        for (Index& corner : t) corner = cut ? cut->wedge_of_leaf(corner) : tree.wedge_of_leaf(corner);
        mesh.triangles.push_back(t);
    }
    return mesh;
}

// From points all over one surface, its corners among them, to the other.
double farthest(const Mesh& from, const Mesh& to, std::size_t points) {
    const app::SurfaceDistance distance(to);
    std::mt19937_64 random(1);
    std::vector<double> areas;
    double area = 0, most = 0;
    for (const Triangle& t : from.triangles) {
        const glm::dvec3 a = from.positions[t[0]];
        areas.push_back(area += glm::length(glm::cross(from.positions[t[1]] - a, from.positions[t[2]] - a)));
    }
    for (std::size_t i = 0; i < points; ++i) {
        const auto at = std::ranges::lower_bound(areas, shapes::random_unit(random) * area);
        const Triangle& t =
            from.triangles[std::min(static_cast<std::size_t>(at - areas.begin()), from.triangles.size() - 1)];
        double u = shapes::random_unit(random), v = shapes::random_unit(random);
        if (u + v > 1) u = 1 - u, v = 1 - v;
        const glm::dvec3 a = from.positions[t[0]];
        most = std::max(most, distance(a + u * (from.positions[t[1]] - a) + v * (from.positions[t[2]] - a)));
    }
    const std::size_t step = std::max<std::size_t>(1, from.triangles.size() / points);
    for (std::size_t i = 0; i < from.triangles.size(); i += step)
        for (const Index v : from.triangles[i]) most = std::max(most, distance(from.positions[v]));
    return most;
}

// Both ways, at some displacements that are shares of the bounding sphere's radius.
void expect_bounded(const std::string& name, const VertexTree& tree, std::size_t points) {
    const Mesh whole = surface_of(tree, nullptr);
    const double radius = tree.bounding_sphere().radius;
    for (const double share : {0.001, 0.01, 0.05}) {
        const Cut cut = cut_by(tree, share * radius);
        const Mesh drawn = surface_of(tree, &cut);
        const double there = farthest(whole, drawn, points) / radius, back = farthest(drawn, whole, points) / radius;
        std::cout << name << ": " << cut.triangle_count() << " of " << tree.triangle_count() << " triangles at "
                  << share << ", to the cut " << there / share << ", back " << back / share << '\n';
        EXPECT_LE(there, share) << name;
        EXPECT_LE(back, share) << name;
    }
}

// Around the z axis, from the radius at z = 0 to that at z = 1, open at the ends or with the disc there.
Mesh lathe(int around, int along, double from, double to, bool has_ends) {
    Mesh mesh;
    for (int j = 0; j <= along; ++j)
        for (int i = 0; i < around; ++i) {
            const double a = 2 * std::numbers::pi * i / around, z = double(j) / along, r = from + (to - from) * z;
            mesh.positions.emplace_back(r * std::cos(a), r * std::sin(a), z);
        }
    const auto at = [&](int i, int j) { return static_cast<Index>(j * around + i % around); };
    for (int j = 0; j < along; ++j)
        for (int i = 0; i < around; ++i) {
            mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
            mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
        }
    for (const int j : {0, along}) {
        const Index middle = static_cast<Index>(mesh.positions.size());
        if (!has_ends || (j == 0 ? from : to) == 0) continue;
        mesh.positions.emplace_back(0, 0, double(j) / along);
        for (int i = 0; i < around; ++i)
            mesh.triangles.push_back(j == 0 ? Triangle{at(i + 1, j), at(i, j), middle}
                                            : Triangle{at(i, j), at(i + 1, j), middle});
    }
    return mesh;
}

TEST(Displacement, BoundsTheDistanceBetweenSurfacesBothWays) {
    for (const shapes::Named& shape : std::vector<shapes::Named>{
             {"grid", shapes::grid(24)},
             {"cube", shapes::cube(12)},
             {"sphere", shapes::icosphere(4)},
             {"bumpy sphere", shapes::bumpy_sphere(4)},
             {"spiky star", shapes::spiky_star(3)},
             {"torus", shapes::torus(60, 30)},
             {"tube", lathe(64, 20, 1, 1, false)},
             {"cylinder", lathe(64, 20, 1, 1, true)},
             {"cone", lathe(64, 20, 1, 0, true)},
             {"disc", lathe(500, 1, 1, 0, false)},
             {"soup", shapes::random_soup(20, 30, 3)},
             {"book", shapes::non_manifold_fan(9)},
         }) {
        expect_bounded(shape.name, support::built(shape.mesh), 1000);
        if (shape.name == "grid" || shape.name == "cube" || shape.name == "cone")
            expect_bounded(shape.name + ", octree", support::built(shape.mesh, {.clusterer = ClustererKind::octree}),
                           2000);
    }
}

// In units of the radius: far below a pixel.
constexpr double next_to_nothing = 2e-4;

TEST(Displacement, IsNothingInPlanesAndAlongEdges) {
    const auto left = [](const Mesh& mesh) {
        const VertexTree tree = support::built(mesh);
        return cut_by(tree, next_to_nothing * static_cast<double>(tree.bounding_sphere().radius)).triangle_count();
    };
    EXPECT_LE(left(shapes::grid(64)), 4u);
    EXPECT_LE(left(shapes::cube(32)), 64u);
    const glm::dquat tilt = glm::angleAxis(0.4, glm::normalize(glm::dvec3(1, 2, 3)));
    Mesh tilted = shapes::cube(32);
    for (glm::dvec3& p : tilted.positions) p = tilt * p;
    EXPECT_LE(left(tilted), 64u);
    Mesh leaf; // bent along the middle, with a sharp tip
    leaf.positions = {{0, 0, 0}, {1, -0.1, 0.1}, {1, 0, 0}, {1, 0.1, 0.1}};
    leaf.triangles = {{0, 1, 2}, {0, 2, 3}};
    EXPECT_EQ(left(leaf), 2u);
    EXPECT_LE(left(lathe(12, 100, 1, 1, false)), 2 * 12 * 2u); // along a tube
}

// A ball needs about 4 / (s * sqrt(3)) triangles where each may be s radii off; the bound counts more than a fold does.
TEST(Displacement, GrowsWithTheSquareOfTheSizeOnCurvedSurfaces) {
    const VertexTree tree = support::built(shapes::icosphere(6));
    for (const double share : {0.001, 0.004, 0.016}) {
        const Index triangles = cut_by(tree, share).triangle_count();
        std::cout << "ball: " << triangles << " triangles at " << share << '\n';
        EXPECT_LE(triangles, 10 * 4 / (share * std::sqrt(3))) << share;
    }
}

TEST(Displacement, BoundsTheDistanceOnFurtherMeshes) {
    const auto files = support::extra_meshes();
    if (files.empty()) GTEST_SKIP() << "UNSEEN_EXTRA_MESHES is not set";
    const support::TempFolder scratch;
    constexpr std::size_t most_triangles = 50'000, points = 1000;
    for (const auto& file : files) {
        const auto read = meshio::read_mesh(support::uncompressed(file, scratch.path()));
        if (!read || read->mesh.triangles.size() > most_triangles) continue;
        const auto tree = build_tree(read->mesh.view());
        if (tree) expect_bounded(file.filename().string(), *tree, points);
    }
}

} // namespace
} // namespace unseen::vdtree
