// Bounds of trees in exact arithmetic.
#include <unseen/exact/exact.h>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/internal/vertex_tree_data.h>

#include "built.h"
#include "shapes.h"
#include "testing.h"

namespace unseen::exact {
namespace {

using vdtree::Mesh;
using vdtree::NodeId;
using vdtree::Sphere;
using vdtree::VertexTree;

// The tree with another array: of a tree that nobody else has.
template <class Change>
VertexTree changed(VertexTree tree, Change&& change) {
    change(const_cast<vdtree::TreeGeometry&>(*tree.data().geometry)); // made by the builder, and not as a constant
    return tree;
}

template <class T>
std::vector<T> copied(std::span<const T> values) {
    return {values.begin(), values.end()};
}

TEST(VerifyExactly, TreesOfAllShapesAreSound) {
    for (const shapes::Named& shape : shapes::all())
        for (const auto kind : {vdtree::ClustererKind::quadric, vdtree::ClustererKind::octree}) {
            const auto tree = vdtree::build_tree(shape.mesh.view(), {.clusterer = kind});
            if (!tree) continue; // shapes that no tree can be built of
            const auto verified = require(verify_exactly(*tree));
            EXPECT_GT(verified->comparisons, tree->node_count()) << shape.name;
            EXPECT_LT(verified->in_rationals, verified->comparisons) << shape.name;
        }
}

TEST(VerifyExactly, NeedlesAndFarPlacesAreSound) {
    std::mt19937_64 random(7);
    Mesh needles; // so thin that doubles do not know where they face
    for (int i = 0; i < 200; ++i) {
        const auto first = static_cast<vdtree::Index>(needles.positions.size());
        const glm::dvec3 a = shapes::random_direction(random), along = shapes::random_direction(random);
        needles.positions.push_back(a);
        needles.positions.push_back(shapes::rounded_to_float(a + along));
        needles.positions.push_back(shapes::rounded_to_float(a + along * shapes::random_unit(random)));
        needles.triangles.push_back({first, first + 1, first + 2});
    }
    const Mesh sphere = shapes::bumpy_sphere(3);
    for (const Mesh& mesh : {needles, shapes::placed(sphere, 1e-19), shapes::placed(sphere, 1e25),
                             shapes::placed(sphere, 1, {5e6, 3e5, 100})}) {
        const auto verified = verify_exactly(support::built(mesh));
        EXPECT_TRUE(verified) << verified.error().message;
    }
}

// What a slack of 1e-14 lets pass, and exact arithmetic does not.
TEST(VerifyExactly, SeesWhatDoublesCannot) {
    Mesh mesh;
    mesh.positions = {{1, 0x1p-24, 0}, {-0.5, 0, 0}, {0, 0.5, 0}, {0, 0, 0.5}};
    mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
    const auto flat = [](const vdtree::ClusterInput& input) -> Result<vdtree::Clustering> {
        vdtree::Clustering clustering;
        clustering.parents.assign(input.mesh.positions.size() + 1, 4);
        return clustering;
    };
    const auto tree = require(vdtree::build_tree(mesh.view(), flat));
    ASSERT_EQ(tree->interior_count(), 1u);
    EXPECT_TRUE(verify_exactly(*tree));
    const VertexTree tight = changed(tree->share(), [](vdtree::TreeGeometry& g) {
        g.support_spheres = std::vector<Sphere>{{glm::vec3(0), 1.0f}}; // the first vertex is at 1 + 2^-49
    });
    EXPECT_TRUE(vdtree::verify(tight));
    EXPECT_THAT(error_in(verify_exactly(tight)), HasSubstr("Node 0: the support's sphere does not contain a leaf"));
}

TEST(VerifyExactly, NamesWhatIsWrong) {
    const VertexTree tree = support::built(shapes::bumpy_sphere(3));
    const auto expect_fault = [&](const char* what, auto&& change) {
        EXPECT_THAT(error_in(verify_exactly(changed(support::built(shapes::bumpy_sphere(3)), change))), HasSubstr(what))
            << what;
    };
    expect_fault("a child's support sphere sticks out", [&](vdtree::TreeGeometry& g) {
        auto spheres = copied(tree.support_spheres());
        spheres[1].radius = spheres[0].radius * 1.5f;
        g.support_spheres = std::move(spheres);
    });
    expect_fault("the ring's sphere does not contain", [&](vdtree::TreeGeometry& g) {
        auto bounds = copied(tree.bounds());
        bounds[5].ring.radius = 0;
        bounds[5].ring.centre += 0.125f;
        g.bounds = std::move(bounds);
    });
    expect_fault("outside of the slabs", [&](vdtree::TreeGeometry& g) {
        auto bounds = copied(tree.bounds());
        for (auto& b : bounds) b.slabs.hi[3] = static_cast<std::int8_t>(b.slabs.hi[3] - 2);
        g.bounds = std::move(bounds);
    });
    expect_fault("farther from the proxy than the displacement", [&](vdtree::TreeGeometry& g) {
        auto displacement = copied(tree.displacement());
        displacement.back() *= 0.5f; // of two leaves
        g.displacement = std::move(displacement);
    });
    expect_fault("a triangle's plane is farther", [&](vdtree::TreeGeometry& g) {
        auto displacement = copied(tree.displacement());
        displacement[0] = std::nanf("");
        g.displacement = std::move(displacement);
    });
}

TEST(VerifyExactly, CanBeCancelled) {
    const auto verified =
        verify_exactly(support::built(shapes::bumpy_sphere(2)), [](double, const char*) { return false; });
    ASSERT_FALSE(verified);
    EXPECT_EQ(verified.error().code, ErrorCode::cancelled);
}

} // namespace
} // namespace unseen::exact
