// Every real mesh in the folder UNSEEN_EXTRA_MESHES is built with both clusterers, verified, cut and unfolded. Prints
// a table.
#include <unseen/vdtree/builder.h>

#include <cctype>

#include <unseen/meshio/mesh_file.h>
#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/tree_io.h>

#include "exact.h"
#include "extra_meshes.h"
#include "shapes.h"
#include "temp_folder.h"
#include "testing.h"
#include "tree_checks.h"

namespace unseen::vdtree::extra_meshes_test {

class ExtraMesh : public testing::TestWithParam<std::filesystem::path> {};

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(ExtraMesh); // without the folder there are none
INSTANTIATE_TEST_SUITE_P(All, ExtraMesh, testing::ValuesIn(support::extra_meshes()), [](const auto& param_info) {
    std::string name = std::to_string(param_info.index) + "_" + param_info.param.filename().string();
    for (char& c : name)
        if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
    return name;
});

// Spheres of children and leaves, in exact arithmetic; what lies deeper follows.
std::string fault_in_spheres(const VertexTree& tree) {
    std::string fault;
    for (NodeId node = 0; node < tree.interior_count(); ++node) {
        const Sphere support = tree.support_spheres()[node], ring = tree.bounds()[node].ring;
        bool holds = support::contains(support, tree.position(node)) && support::contains(ring, tree.position(node));
        tree.for_each_child(node, [&](NodeId child) {
            if (tree.is_place(child)) {
                holds &=
                    support::contains(support, tree.position(child)) && support::contains(ring, tree.position(child));
                return;
            }
            const Sphere s = tree.support_spheres()[child], r = tree.bounds()[child].ring;
            holds &= support::contains(support, s.centre, s.radius) && support::contains(ring, r.centre, r.radius);
        });
        if (!holds) return "node " + std::to_string(node);
    }
    return fault;
}

void check(const VertexTree& tree, const Mesh& mesh) {
    const auto verified = require(verify(tree));
    ASSERT_EQ(support::fault_in_structure(tree), "");
    ASSERT_EQ(support::fault_when_unfolded(tree, mesh.view()), "");
    ASSERT_EQ(fault_in_spheres(tree), "");
    // Cuts from a few sides.
    std::mt19937_64 random(1);
    Cut kept(tree);
    for (int round = 0; round < 4; ++round) {
        const Sphere ball = tree.bounding_sphere();
        if (!(ball.radius > 0)) break; // all at one point
        const View view = frame_sphere(tree.origin() + glm::dvec3(ball.centre), ball.radius,
                                       shapes::random_direction(random), 0.9, {});
        const auto extent = require(extent_criterion(tree, view, shapes::random_between(random, 2, 40)));
        const Viewpoint viewpoint{.eye = eye_in_tree(tree, view, {}), .frusta = {frustum_of(tree, view)}};
        FollowOptions options;
        if (round % 2) options.triangle_budget = tree.triangle_count() / 3;
        ASSERT_TRUE(kept.follow(*extent, viewpoint, options));
        ASSERT_EQ(support::fault_in_cut(kept), "");
        Cut fresh(tree);
        ASSERT_TRUE(fresh.follow(*extent, viewpoint, options));
        ASSERT_TRUE(support::sorted_triangles(kept) == support::sorted_triangles(fresh));
    }
}

TEST_P(ExtraMesh, BuildsVerifiesAndUnfolds) {
    const support::TempFolder scratch;
    const auto file = support::uncompressed(GetParam(), scratch.path());
    ASSERT_FALSE(file.empty()) << "the program zstd cannot unpack " << GetParam();
    const auto read = meshio::read_mesh(file);
    if (!read) {
        // Only files that are there to be refused may be; which of them, malformed_mesh_test knows.
        ASSERT_EQ(GetParam().parent_path().filename(), "malformed") << read.error().message;
        return;
    }
    for (const ClustererKind kind : {ClustererKind::quadric, ClustererKind::octree}) {
        SCOPED_TRACE(name(kind));
        const auto begin = std::chrono::steady_clock::now();
        const auto tree = build_tree(read->mesh.view(), {.clusterer = kind});
        const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
        if (!tree) {
            ASSERT_EQ(GetParam().parent_path().filename(), "malformed") << tree.error().message;
            return;
        }
        std::printf("%-36s %-8s %9u triangles %8.2f s %6.0f bytes a triangle\n", file.filename().c_str(),
                    name(kind).data(), tree->triangle_count(), seconds.count(),
                    static_cast<double>(tree->byte_size()) / tree->triangle_count());
        check(*tree, read->mesh);
        if (testing::Test::HasFatalFailure()) return;
        const auto tree_file = scratch / "tree.vdt";
        ASSERT_TRUE(write_tree(tree_file, *tree));
        EXPECT_EQ(support::difference(*tree, *require(read_tree(tree_file))), "");
    }
}

TEST(ExtraMeshes, AreThereWhereTheFolderIs) {
    if (support::extra_mesh_folder().empty()) GTEST_SKIP() << "UNSEEN_EXTRA_MESHES names no folder of further meshes";
    EXPECT_FALSE(support::extra_meshes().empty()) << support::extra_mesh_folder();
}

} // namespace unseen::vdtree::extra_meshes_test
