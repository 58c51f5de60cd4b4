// The rings of all cuts: whatever is folded, no triangle leaves the bounds of the largest of its nodes.
#include <unseen/perception/internal/cut_rings.h>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/internal/light_bounds.h>

#include "built.h"
#include "shapes.h"
#include "sound.h"
#include "testing.h"

namespace unseen::perception {

using namespace vdtree;

namespace cut_rings_test {

using support::built;

bool is_larger(const VertexTree& tree, NodeId a, NodeId b) {
    const float ra = tree.support_spheres()[a].radius, rb = tree.support_spheres()[b].radius;
    return ra != rb ? ra > rb : a < b;
}

// Of a triangle's corners that are proxies; no_node where none is.
NodeId largest_of(const VertexTree& tree, std::span<const WedgeId> corners) {
    NodeId largest = no_node;
    for (const WedgeId wedge : corners)
        if (const NodeId corner = support::node_of(tree, wedge);
            !tree.is_place(corner) && (largest == no_node || is_larger(tree, corner, largest)))
            largest = corner;
    return largest;
}

// Triangles of cuts that have a proxy, and how many of them the mesh's own rings do not hold.
struct Looked {
    int at = 0, outside_of_mesh_rings = 0;
};

Looked expect_within_rings(const Cut& cut, const CutRings& rings) {
    const VertexTree& tree = cut.tree();
    const auto indices = cut.indices();
    Looked looked;
    for (std::size_t i = 0; i < indices.size(); i += 3) {
        const NodeId largest = largest_of(tree, indices.subspan(i, 3));
        if (largest == no_node) continue;
        ++looked.at;
        bool is_outside = false;
        for (std::size_t k = 0; k < 3; ++k) {
            const WedgeId corner = indices[i + k];
            const double distance =
                glm::length(glm::dvec3(tree.positions()[corner]) - glm::dvec3(tree.bounds()[largest].ring.centre));
            is_outside |= distance > tree.bounds()[largest].ring.radius ||
                          tree.luminance()[corner] < tree.ring_luminance()[largest].lo ||
                          tree.luminance()[corner] > tree.ring_luminance()[largest].hi;
            EXPECT_LE(distance, rings.radius[largest] * (1 + 1e-12)) << largest;
            EXPECT_LE(rings.luminance[largest].lo, tree.luminance()[corner]) << largest;
            EXPECT_GE(rings.luminance[largest].hi, tree.luminance()[corner]) << largest;
        }
        looked.outside_of_mesh_rings += is_outside;
    }
    return looked;
}

// Any cut at all: nodes unfold at random, as often near the root as among the leaves.
Cut random_cut(const VertexTree& tree, std::mt19937& random) {
    std::vector<float> costs(tree.interior_count());
    std::uniform_real_distribution<float> uniform(0, 1);
    const float keep = uniform(random);
    for (NodeId node = 0; node < costs.size(); ++node) {
        const float above = node == 0 ? 2 : costs[support::sound(tree).parents()[node]];
        const float steepness = std::log2(static_cast<float>(tree.leaf_count())) * 2;
        costs[node] = above > 1 && uniform(random) < 1 - keep / steepness ? 2.0f : 0.0f;
    }
    Cut cut(tree);
    cut.adjust([&](const VertexTree&, std::span<const NodeId> nodes, std::span<float> out) {
        for (std::size_t i = 0; i < nodes.size(); ++i) out[i] = costs[nodes[i]];
    });
    return cut;
}

TEST(CutRings, HoldEveryTriangleOfEveryCut) {
    std::mt19937 random(11);
    Looked looked;
    const Mesh meshes[] = {shapes::bumpy_sphere(4, 0.03),
                           shapes::with_attributes(shapes::torus(40, 20)),
                           shapes::grid(20),
                           shapes::two_parts(),
                           shapes::random_soup(200, 400, 3),
                           shapes::unwelded(shapes::icosphere(2)),
                           shapes::non_manifold_fan(7)};
    for (const Mesh& mesh : meshes) {
        for (const ClustererKind clusterer : {ClustererKind::quadric, ClustererKind::octree}) {
            const VertexTree tree = built(mesh, {.clusterer = clusterer});
            const CutRings rings = *bound_cut_rings(tree);
            for (int trial = 0; trial < 24; ++trial) {
                const Looked here = expect_within_rings(random_cut(tree, random), rings);
                looked.at += here.at;
                looked.outside_of_mesh_rings += here.outside_of_mesh_rings;
            }
        }
    }
    EXPECT_GT(looked.at, 10000);
    EXPECT_GT(looked.outside_of_mesh_rings, 500);
}

TEST(CutRings, ContainTheMeshsRingsAndNest) {
    const VertexTree tree = built(shapes::bumpy_sphere(5, 0.02));
    const CutRings rings = *bound_cut_rings(tree);
    int wider = 0;
    for (NodeId node = 0; node < tree.interior_count(); ++node) {
        EXPECT_LE(rings.luminance[node].lo, tree.ring_luminance()[node].lo);
        EXPECT_GE(rings.luminance[node].hi, tree.ring_luminance()[node].hi);
        EXPECT_GE(rings.radius[node], tree.bounds()[node].ring.radius);
        wider += rings.radius[node] > tree.bounds()[node].ring.radius;
        if (node == 0) continue;
        const NodeId parent = support::sound(tree).parents()[node];
        EXPECT_LE(rings.luminance[parent].lo, rings.luminance[node].lo);
        EXPECT_GE(rings.luminance[parent].hi, rings.luminance[node].hi);
        EXPECT_GE(rings.radius[parent], rings.radius[node]);
        EXPECT_GE(rings.mean_shift[parent], rings.mean_shift[node]);
    }
    EXPECT_GT(wider, 100);
}

Lighting random_lighting(std::mt19937_64& random, const VertexTree& tree) {
    Lighting lighting;
    lighting.ambient = 0.1, lighting.specular = 0.3, lighting.shininess = 20;
    LightSource& far = lighting.lights.emplace_back();
    far.intensity = 0.6;
    far.direction = shapes::random_direction(random);
    LightSource& near = lighting.lights.emplace_back();
    near.kind = LightSource::Kind::point;
    near.intensity = 0.4;
    near.distance = static_cast<double>(tree.bounding_sphere().radius);
    near.position = glm::dvec3(tree.bounding_sphere().centre) + 1.2 * near.distance * shapes::random_direction(random);
    return lighting;
}

TEST(LitCutRings, HoldWhatLightsMakeOfEveryTriangleOfEveryCut) {
    std::mt19937 random(12);
    std::mt19937_64 of_lights(13);
    int looked_at = 0, outside_of_mesh_rings = 0;
    for (const Mesh& mesh :
         {shapes::bumpy_sphere(4, 0.03), shapes::with_attributes(shapes::torus(40, 20)), shapes::two_parts(),
          shapes::random_soup(200, 400, 3), shapes::unwelded(shapes::cube(6))}) {
        const VertexTree tree = built(mesh);
        const LightBounds rings = *bound_lit_cut_rings(tree, *bound_cut_rings(tree)),
                          mesh_rings = *LightBounds::measure(tree);
        for (int trial = 0; trial < 16; ++trial) {
            const Lighting lighting = random_lighting(of_lights, tree);
            const glm::dvec3 eye =
                3.0 * static_cast<double>(tree.bounding_sphere().radius) * shapes::random_direction(of_lights);
            const Cut cut = random_cut(tree, random);
            for (std::size_t i = 0; i < cut.indices().size(); i += 3) {
                const auto corners = cut.indices().subspan(i, 3);
                const NodeId largest = largest_of(tree, corners);
                if (largest == no_node) continue;
                const LuminanceRange range =
                    lit_range(lighting, rings.cones()[largest], rings.sphere(tree, largest), eye);
                const LuminanceRange of_mesh =
                    lit_range(lighting, mesh_rings.cones()[largest], mesh_rings.sphere(tree, largest), eye);
                for (const WedgeId corner : corners) {
                    const double y = lit_luminance(lighting, glm::dvec3(tree.positions()[corner]),
                                                   glm::dvec3(glm::vec3(tree.normals()[corner])),
                                                   static_cast<double>(albedo_of(tree, corner)), eye);
                    ASSERT_GE(y, range.lo) << largest;
                    ASSERT_LE(y, range.hi) << largest;
                    outside_of_mesh_rings += !(y >= of_mesh.lo && y <= of_mesh.hi);
                    ++looked_at;
                }
            }
        }
    }
    EXPECT_GT(looked_at, 10000);
    EXPECT_GT(outside_of_mesh_rings, 5);
}

// A chain as deep as there are vertices: it takes no longer than another tree, and its bounds hold.
TEST(CutRings, OfADeepTreeAreQuicklyBounded) {
    const Mesh mesh = shapes::with_attributes(shapes::grid(60));
    const auto chain = [](const ClusterInput& input) -> Result<Clustering> {
        const Index vertices = static_cast<Index>(input.mesh.positions.size());
        Clustering clustering;
        for (Index v = 0; v < vertices; ++v) clustering.parents.push_back(v < 2 ? vertices : vertices + v - 1);
        for (Index c = 1; c < vertices; ++c) clustering.parents.push_back(std::min(vertices + c, 2 * vertices - 2));
        return clustering;
    };
    auto tree = require(build_tree(mesh.view(), chain));
    const CutRings rings = *bound_cut_rings(*tree);
    std::mt19937 random(5);
    for (int trial = 0; trial < 5; ++trial) expect_within_rings(random_cut(*tree, random), rings);
    EXPECT_TRUE(bound_lit_cut_rings(*tree, rings));
}

// Two squares side by side, the right edge brighter: folding the middle edge to one of its ends leaves the light as it
// is only where nothing differs.
TEST(CutRings, FindShiftsOfTheMean) {
    const auto strip = [](float middle, float outer) {
        // 3 - 4 - 5   heights 1, widths 1
        // | / | / |
        // 0 - 1 - 2
        Mesh mesh;
        mesh.positions = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 1, 0}, {1, 1, 0}, {2, 1, 0}};
        mesh.triangles = {{0, 1, 4}, {0, 4, 3}, {1, 2, 5}, {1, 5, 4}};
        for (const float y : {outer, middle, outer, outer, middle, outer}) mesh.colours.push_back({y, y, y, 1});
        return mesh;
    };
    const auto merge_middle = [](const ClusterInput&) -> Result<Clustering> {
        Clustering clustering;
        clustering.parents = {7, 6, 7, 7, 6, 7, 7, 7};
        clustering.positions = {{1, 1, 0}, {1, 0.5, 0}}; // of the edge and of the root
        return clustering;
    };
    auto even = require(build_tree(strip(0.5f, 0.5f).view(), merge_middle, {.prelit = true})),
         bright = require(build_tree(strip(1, 0.25f).view(), merge_middle, {.prelit = true}));
    ASSERT_EQ(even->interior_count(), 2u); // the root and the edge
    constexpr NodeId node = 1;
    EXPECT_NEAR(bound_cut_rings(*even)->mean_shift[node], 0, 1e-6);
    // Before: each triangle has the area 1/2; two have one bright corner, two have two: 3/6 of the corners: mean 0.625.
    // After, at (1, 1): the triangles (0, p, 3) and (2, 5, p), one bright corner each: areas 1/2, mean 0.5. The shift,
    // -0.125 times the area of 1 after it, over the edge's share of the area, 6 corners of the 12: 1.
    EXPECT_NEAR(bound_cut_rings(*bright)->mean_shift[node], 0.125, 1e-4);
}

} // namespace cut_rings_test
} // namespace unseen::perception
