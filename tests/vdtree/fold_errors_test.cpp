// What folds get wrong: nothing where nothing can be wrong, more up the tree, and the same for any number of threads.
#include <vdtree/fold_errors.h>

#include <cmath>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <vdtree/builder.h>

#include "shapes.h"

namespace unseen::vdtree {
namespace {

VertexTree built(const Mesh& mesh) {
    Result<VertexTree> tree = build_tree(mesh.view(), {.threads = 1});
    if (!tree) throw std::runtime_error(tree.error().message);
    return std::move(*tree);
}

// A flat square of n x n quads whose grey is a function of the place.
template <class Grey>
Mesh painted_square(int n, Grey&& grey) {
    Mesh mesh = shapes::grid(n);
    for (const glm::dvec3& p : mesh.positions) {
        const auto g = static_cast<float>(grey(p));
        mesh.colours.push_back({g, g, g, 1});
    }
    return mesh;
}

// Both are rounded outward, each in its own way: a unit apart at most.
bool includes(const NormalSlabs& all, const NormalSlabs& one) {
    for (std::size_t i = 0; i < NormalSlabs::axis_count; ++i)
        if (all.lo[i] > one.lo[i] + 1 || all.hi[i] < one.hi[i] - 1) return false;
    return true;
}

TEST(FoldErrors, OfAFlatEvenSquareAreNoneInLuminance) {
    const VertexTree tree = built(painted_square(12, [](glm::dvec3) { return 0.5; }));
    const FoldErrors errors = measure_fold_errors(tree, 1);
    for (NodeId node = 0; node < tree.interior_count(); ++node) {
        EXPECT_EQ(errors.luminance[node], 0) << node;
        EXPECT_EQ(errors.shift[node], 0) << node;
        EXPECT_EQ(errors.mean[node], 0) << node;
    }
}

// A step in luminance: nodes on it have all of it as their error, nodes far from it nothing.
TEST(FoldErrors, FindAStep) {
    const VertexTree tree = built(painted_square(16, [](glm::dvec3 p) { return p.x < 0.5 ? 0.2 : 0.8; }));
    const FoldErrors errors = measure_fold_errors(tree, 1);
    int flat = 0, mixed = 0;
    for (NodeId node = 1; node < tree.interior_count(); ++node) {
        const LuminanceRange ring = tree.ring_luminance()[node], support = tree.support_luminance()[node];
        if (ring.hi - ring.lo < 1e-3f) {
            // Neighbours may fold over the step, which the ring does not see.
            flat += errors.luminance[node] < 1e-3f;
        }
        if (support.hi - support.lo > 0.5f) {
            ++mixed;
            EXPECT_GT(errors.luminance[node], 0.2f) << node;
        }
    }
    EXPECT_GT(flat, 20);
    EXPECT_GT(mixed, 2);
}

TEST(FoldErrors, GrowUpTheTreeAndHoldTheirDirections) {
    for (const Mesh& mesh : {shapes::bumpy_sphere(4, 0.05), shapes::random_soup(300, 800, 3), shapes::torus(24, 12)}) {
        const VertexTree tree = built(mesh);
        const FoldErrors errors = measure_fold_errors(tree, 1);
        for (NodeId node = 1; node < tree.interior_count(); ++node) {
            const NodeId parent = tree.parents()[node];
            ASSERT_GE(errors.distance[parent], errors.distance[node]);
            ASSERT_GE(errors.luminance[parent], errors.luminance[node]);
            ASSERT_GE(errors.shift[parent], errors.shift[node]);
            ASSERT_GE(errors.mean[parent], errors.mean[node]);
            ASSERT_GE(errors.extent[parent], errors.extent[node]);
            ASSERT_TRUE(errors.facing[parent].includes(errors.facing[node]));
        }
        // Every triangle that touches a node's support is among its directions.
        const auto place = [&](Index leaf) { return glm::dvec3(tree.positions()[tree.interior_count() + leaf]); };
        for (const Triangle& t : tree.triangles()) {
            const glm::dvec3 normal = glm::cross(place(t[1]) - place(t[0]), place(t[2]) - place(t[0]));
            if (!(glm::length(normal) > 1e-9)) continue;
            NormalSlabs own;
            own.insert(glm::normalize(normal));
            for (const Index leaf : t) {
                ASSERT_TRUE(includes(errors.facing[tree.parents()[tree.interior_count() + leaf]], own));
            }
        }
    }
}

TEST(FoldErrors, AreTheSameForAnyNumberOfThreads) {
    const VertexTree tree = built(shapes::bumpy_sphere(5, 0.02));
    const FoldErrors one = measure_fold_errors(tree, 1), four = measure_fold_errors(tree, 4);
    EXPECT_EQ(one.distance, four.distance);
    EXPECT_EQ(one.luminance, four.luminance);
    EXPECT_EQ(one.shift, four.shift);
    EXPECT_EQ(one.mean, four.mean);
    EXPECT_EQ(one.extent, four.extent);
    EXPECT_EQ(one.facing, four.facing);
}

TEST(FoldErrors, AreFiniteForHardMeshes) {
    for (const Mesh& mesh : {shapes::single_triangle(), shapes::all_coincident(200), shapes::with_zero_areas(), shapes::non_manifold_fan(5),
                             shapes::moebius_strip(20)}) {
        const VertexTree tree = built(mesh);
        const FoldErrors errors = measure_fold_errors(tree, 2);
        for (NodeId node = 0; node < tree.interior_count(); ++node)
            for (const float value : {errors.distance[node], errors.luminance[node], errors.shift[node], errors.mean[node], errors.extent[node]})
                ASSERT_TRUE(std::isfinite(value) && value >= 0);
    }
}

} // namespace
} // namespace unseen::vdtree
