// Corners with values of their own, at every budget: charts, hard edges and corners of made things.
#include <unseen/vdtree/builder.h>

#include <ctime>
#include <map>
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

// A bumpy ball of six charts of an atlas, with gaps between them.
Mesh ball_with_atlas(int n) {
    Mesh mesh;
    for (int chart = 0; chart < 6; ++chart) {
        const int axis = chart / 2;
        const double sign = chart % 2 ? 1 : -1;
        const auto first = static_cast<Index>(mesh.positions.size()), row = static_cast<Index>(n) + 1;
        for (int i = 0; i <= n; ++i)
            for (int j = 0; j <= n; ++j) {
                const double s = static_cast<double>(i) / n, t = static_cast<double>(j) / n;
                glm::dvec3 p;
                p[axis] = sign;
                p[(axis + 1) % 3] = std::tan(std::numbers::pi / 4 * (2 * s - 1));
                p[(axis + 2) % 3] = sign * std::tan(std::numbers::pi / 4 * (2 * t - 1));
                p = glm::normalize(p);
                // Both sides of a seam get the same bits.
                p = glm::round(p * (1 + 0.06 * std::sin(7 * p.x) * std::sin(6 * p.y + 1)) * 0x1p20) * 0x1p-20;
                mesh.positions.push_back(p);
                mesh.uvs.emplace_back((chart % 3 + 0.05 + 0.9 * s) / 3, (chart / 3 + 0.05 + 0.9 * t) / 2);
            }
        for (Index i = 0; i + 1 < row; ++i)
            for (Index j = 0; j + 1 < row; ++j) {
                const Index a = first + i * row + j;
                mesh.triangles.push_back({a, a + row, a + row + 1});
                mesh.triangles.push_back({a, a + row + 1, a + 1});
            }
    }
    return mesh;
}

double uv_area(const Mesh& mesh) {
    double sum = 0;
    for (const Triangle& t : mesh.triangles) {
        const glm::dvec2 e(mesh.uvs[t[1]] - mesh.uvs[t[0]]), f(mesh.uvs[t[2]] - mesh.uvs[t[0]]);
        sum += std::abs(e.x * f.y - e.y * f.x) / 2;
    }
    return sum;
}

// Sums the lengths in the texture of both sides of each edge whose sides differ in their coordinates.
double seam_length(const Mesh& mesh) {
    using Place = std::array<double, 3>;
    std::map<std::pair<Place, Place>, std::vector<std::array<glm::vec2, 2>>> sides;
    const auto place = [&](Index v) { return Place{mesh.positions[v].x, mesh.positions[v].y, mesh.positions[v].z}; };
    for (const Triangle& t : mesh.triangles)
        for (std::size_t k = 0; k < 3; ++k) {
            Index a = t[k], b = t[(k + 1) % 3];
            if (place(b) < place(a)) std::swap(a, b);
            sides[{place(a), place(b)}].push_back({mesh.uvs[a], mesh.uvs[b]});
        }
    double sum = 0;
    for (const auto& [edge, uvs] : sides) {
        EXPECT_EQ(uvs.size(), 2u) << "it stays closed";
        if (uvs.size() != 2 || uvs[0] == uvs[1]) continue;
        for (const auto& ends : uvs) sum += static_cast<double>(glm::distance(ends[0], ends[1]));
    }
    return sum;
}

TEST(Corners, AnAtlasKeepsItsAreaAndTheLengthOfItsSeams) {
    const Mesh whole = ball_with_atlas(32);
    const double area = uv_area(whole), length = seam_length(whole);
    EXPECT_NEAR(length, 12 * (0.9 / 3 + 0.9 / 2), 1e-4) << "four sides of six charts";
    const VertexTree tree = support::built(whole);
    struct {
        double kept, area, length; // how far off, of the whole's
    } const budgets[] = {{0.5, 0.02, 0.1}, {0.3, 0.03, 0.1}, {0.1, 0.1, 0.1}};
    for (const auto& most : budgets) {
        const Mesh cut = with_at_most(tree, static_cast<Index>(most.kept * tree.triangle_count()));
        EXPECT_GT(static_cast<double>(cut.triangles.size()), 0.9 * most.kept * tree.triangle_count());
        EXPECT_NEAR(uv_area(cut) / area, 1, most.area) << most.kept;
        EXPECT_LT(seam_length(cut), (1 + most.length) * length) << most.kept;
    }
}

// A cone whose point has other coordinates in each triangle.
Mesh cone_with_pole(int spokes) {
    Mesh mesh;
    for (int i = 0; i <= spokes; ++i) {
        const double angle = 2 * std::numbers::pi * (i % spokes) / spokes;
        const auto u = static_cast<float>(i) / static_cast<float>(spokes);
        mesh.positions.emplace_back(std::cos(angle), std::sin(angle), 0);
        mesh.uvs.emplace_back(u, 1);
        mesh.positions.emplace_back(0, 0, 1);
        mesh.uvs.emplace_back(u, 0);
        if (i == spokes) continue;
        const auto v = static_cast<Index>(2 * i);
        mesh.triangles.push_back({v, v + 2, v + 1});
    }
    return mesh;
}

TEST(Corners, ThousandsAtAPole) {
    const auto cpu_seconds = [](int spokes) {
        const Mesh cone = cone_with_pole(spokes);
        const std::clock_t start = std::clock();
        const VertexTree tree = support::built(cone);
        EXPECT_EQ(tree.place_count(), static_cast<Index>(spokes + 1));
        EXPECT_EQ(tree.leaf_count(), static_cast<Index>(2 * spokes + 1));
        for (const Index most : {static_cast<Index>(spokes / 2), static_cast<Index>(spokes / 20), 40u}) {
            const Mesh cut = with_at_most(tree, most);
            EXPECT_GT(cut.triangles.size(), 0.9 * most);
            for (const Triangle& t : cut.triangles)
                for (const Index v : t) {
                    const glm::dvec3& p = cut.positions[v];
                    if (glm::length(glm::dvec2(p)) < 0.5) continue;
                    double turn = std::atan2(p.y, p.x) / (2 * std::numbers::pi);
                    turn -= static_cast<double>(cut.uvs[v].x);
                    EXPECT_LT(std::abs(turn - std::round(turn)), 0.05) << most;
                }
        }
        const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
        EXPECT_TRUE(verify(tree));
        return seconds;
    };
    const double few = cpu_seconds(1500), many = cpu_seconds(12000);
    EXPECT_LT(many, 24 * few) << "8 is linear, 64 the square";
}

} // namespace
} // namespace unseen::vdtree
