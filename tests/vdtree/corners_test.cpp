// Corners with values of their own, at every budget: charts, hard edges and corners of made things.
#include <unseen/vdtree/builder.h>

#include <numbers>

#include <unseen/vdtree/cut.h>

#include "built.h"
#include "shapes.h"
#include "testing.h"

namespace unseen::vdtree {
namespace {

// With at most so many triangles, by how far the surface moves.
Mesh with_at_most(const VertexTree& tree, Index triangles) {
    Cut cut(tree);
    cut.adjust(
        [&](const VertexTree& t, std::span<const NodeId> nodes, std::span<float> costs) {
            for (std::size_t i = 0; i < nodes.size(); ++i) costs[i] = 1e6f * t.displacement()[nodes[i]];
        },
        triangles);
    return extract_mesh(cut);
}

// Two squares side by side, each with the whole image: u runs from 0 to 1 twice, and both ends lie at x = 1.
Mesh two_charts(int n) {
    Mesh mesh;
    for (int side = 0; side < 2; ++side) {
        const auto first = static_cast<Index>(mesh.positions.size());
        const Mesh grid = shapes::placed(shapes::grid(n), 1.0 / n);
        for (const glm::dvec3& p : grid.positions) {
            mesh.positions.push_back(p + glm::dvec3(side, 0, 0));
            mesh.uvs.emplace_back(p.x, p.y);
        }
        for (const Triangle& t : grid.triangles) mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    }
    return mesh;
}

TEST(Corners, ChartsThatMeetAreNotTorn) {
    constexpr int n = 8;
    const VertexTree tree = support::built(two_charts(n));
    for (Index most = 4; most <= tree.triangle_count(); most += most < 32 ? 2 : 31) {
        const Mesh cut = with_at_most(tree, most);
        EXPECT_GE(cut.triangles.size(), 2u);
        for (const Triangle& t : cut.triangles) {
            const double middle = (cut.positions[t[0]].x + cut.positions[t[1]].x + cut.positions[t[2]].x) / 3;
            for (const Index v : t) {
                EXPECT_NEAR(cut.uvs[v].x, cut.positions[v].x - (middle > 1 ? 1 : 0), 1e-5) << most;
                EXPECT_NEAR(cut.uvs[v].y, cut.positions[v].y, 1e-5) << most;
            }
        }
    }
    EXPECT_LE(with_at_most(tree, 4).triangles.size(), 4u);
}

// With 12 triangles: Quadric.FoldsACubeToItsTwelveTriangles.
TEST(Corners, NormalsOfABoxAreThoseOfItsFaces) {
    const VertexTree tree = support::built(shapes::cube(24));
    for (const Index most : {2000u, 200u, 60u}) {
        const Mesh box = with_at_most(tree, most);
        EXPECT_GE(box.triangles.size(), 12u);
        for (const Triangle& t : box.triangles) {
            const glm::dvec3 a = box.positions[t[0]];
            const glm::dvec3 face = glm::normalize(glm::cross(box.positions[t[1]] - a, box.positions[t[2]] - a));
            for (const Index v : t) EXPECT_GT(glm::dot(face, glm::dvec3(box.normals[v])), 0.9999) << most;
        }
    }
}

// As from an STL that is welded: no normals, no parts.
TEST(Corners, OfManyBoxesAndCylindersStay) {
    Mesh all;
    std::vector<glm::dvec3> corners;
    constexpr int things = 40, n = 8, around = 48, along = 6;
    for (int i = 0; i < things; ++i) {
        const glm::dvec3 at(30.0 * (i % 8), 30.0 * (i / 8), 0);
        if (i % 2 == 0) {
            all = shapes::together(all, shapes::placed(shapes::cube(n), 5, at));
            for (int k = 0; k < 8; ++k)
                corners.push_back(at + 5.0 * glm::dvec3(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1));
            continue;
        }
        Mesh tube;
        const auto add = [&](int a, int z) {
            const double angle = 2 * std::numbers::pi * a / around;
            tube.positions.push_back(at + glm::dvec3(5 * std::cos(angle), 5 * std::sin(angle), 10.0 * z / along - 5));
        };
        for (int z = 0; z <= along; ++z)
            for (int a = 0; a < around; ++a) add(a, z);
        const auto of = [&](int a, int z) { return static_cast<Index>(z * around + a % around); };
        const auto low = static_cast<Index>(tube.positions.size()), high = low + 1;
        tube.positions.push_back(at - glm::dvec3(0, 0, 5));
        tube.positions.push_back(at + glm::dvec3(0, 0, 5));
        for (int a = 0; a < around; ++a) {
            for (int z = 0; z < along; ++z) {
                tube.triangles.push_back({of(a, z), of(a + 1, z), of(a + 1, z + 1)});
                tube.triangles.push_back({of(a, z), of(a + 1, z + 1), of(a, z + 1)});
            }
            tube.triangles.push_back({low, of(a + 1, 0), of(a, 0)});
            tube.triangles.push_back({high, of(a, along), of(a + 1, along)});
        }
        all = shapes::together(all, tube);
    }
    const VertexTree tree = support::built(all);
    const Mesh tenth = with_at_most(tree, tree.triangle_count() / 10);
    EXPECT_GT(tenth.triangles.size(), tree.triangle_count() / 20u);
    for (const glm::dvec3& corner : corners) {
        double nearest = std::numeric_limits<double>::infinity();
        for (const glm::dvec3& p : tenth.positions) nearest = std::min(nearest, glm::distance(p, corner));
        EXPECT_LT(nearest, 0.01);
    }
}

// The same triangles twice with other coordinates: the tree keeps both.
TEST(Corners, TrianglesThatLieOverEachOtherKeepTheirCoordinates) {
    Mesh mesh = shapes::grid(6);
    for (const glm::dvec3& p : mesh.positions) mesh.uvs.emplace_back(p.x, p.y);
    Mesh twice = mesh;
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
        twice.positions.push_back(mesh.positions[v]);
        twice.uvs.push_back(glm::vec2(20) - mesh.uvs[v]);
    }
    for (Triangle t : mesh.triangles) {
        for (Index& v : t) v += static_cast<Index>(mesh.positions.size());
        twice.triangles.push_back(t);
    }
    const VertexTree tree = support::built(twice);
    EXPECT_EQ(tree.leaf_count(), 2 * tree.place_count());
    EXPECT_TRUE(verify(tree));
    for (const Index most : {100u, 40u, 4u})
        for (const Mesh cut = with_at_most(tree, most); const Triangle& t : cut.triangles)
            for (const Index v : t) {
                const glm::dvec2 own(cut.positions[v]), other = glm::dvec2(20) - own, uv(cut.uvs[v]);
                EXPECT_LT(std::min(glm::distance(uv, own), glm::distance(uv, other)), 1e-4) << most;
            }
}

} // namespace
} // namespace unseen::vdtree
