// Borders and vertices that are to be kept: what never folds is in every cut, where it was, and weights give an order.
#include <map>
#include <set>

#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/tree_io.h>

#include "built.h"
#include "read_bytes.h"
#include "shapes.h"
#include "temp_folder.h"
#include "testing.h"

namespace unseen::vdtree::protection_test {

using support::built;
using Place = std::array<double, 3>;

Place place_of(const glm::dvec3& p) { return {p.x, p.y, p.z}; }

// The edges that one triangle has.
std::set<std::pair<Place, Place>> borders(const Mesh& mesh) {
    std::map<std::pair<Place, Place>, int> uses;
    for (const Triangle& t : mesh.triangles)
        for (std::size_t k = 0; k < 3; ++k) {
            const Place a = place_of(mesh.positions[t[k]]), b = place_of(mesh.positions[t[(k + 1) % 3]]);
            ++uses[std::minmax(a, b)];
        }
    std::set<std::pair<Place, Place>> found;
    for (const auto& [edge, count] : uses)
        if (count == 1) found.insert(edge);
    return found;
}

// Hills of n x n squares, some of whose coordinates no float holds. Columns from `first` on.
Mesh terrain(int n, int first) {
    Mesh mesh = shapes::grid(n);
    for (glm::dvec3& p : mesh.positions) {
        p.x += first;
        p = {500'000.1 + 3.7 * p.x, 0.3 * p.y, 4 * std::sin(0.21 * p.x) * std::cos(0.17 * p.y) + 0.01 * p.x};
    }
    return mesh;
}

DistanceCriterion displacement(const VertexTree& tree) {
    return *displacement_criterion(tree, {.width = 1000, .height = 1000}, 1);
}

// Some viewpoint above a tree.
Viewpoint above(const VertexTree& tree, double radii = 3) {
    const Sphere sphere = tree.bounding_sphere();
    return {.eye = glm::dvec3(sphere.centre) + glm::dvec3(0.1, 0.2, radii) * static_cast<double>(sphere.radius)};
}

struct Chunks : ::testing::TestWithParam<ClustererKind> {};

TEST_P(Chunks, FitEachOtherAtAnyBudget) {
    constexpr int n = 120;
    for (const int first : {-60, 60}) {
        const Mesh left = terrain(n, first - n), right = terrain(n, first);
        const VertexTree trees[] = {built(left, {.clusterer = GetParam(), .border_weight = never_folds}),
                                    built(right, {.clusterer = GetParam(), .border_weight = never_folds})};
        ASSERT_TRUE(verify(trees[0]) && verify(trees[1]));
        for (const double share : {0.5, 0.1, 0.02, 0.0}) {
            const auto budget = static_cast<Index>(share * static_cast<double>(left.triangles.size()));
            for (std::size_t side = 0; side < 2; ++side) {
                Cut cut(trees[side]);
                const auto stats =
                    require(cut.follow(displacement(trees[side]), above(trees[side]), {.triangle_budget = budget}));
                EXPECT_LE(stats->triangles, std::max(budget, trees[side].locked_triangles()));
                EXPECT_EQ(borders(extract_mesh(cut)), borders(side == 0 ? left : right)) << share;
            }
        }
        EXPECT_EQ(trees[0].locked_triangles(), 4u * n) << "a triangle for each border edge";
    }
}
INSTANTIATE_TEST_SUITE_P(All, Chunks, ::testing::Values(ClustererKind::quadric, ClustererKind::octree),
                         [](const auto& info) { return std::string(name(info.param)); });

TEST(Protection, OfManyPlacesStaysInParts) { // more places than one part of the contraction has
    const Mesh mesh = terrain(230, 0);
    for (const int threads : {1, 3}) {
        const VertexTree tree = built(mesh, {.border_weight = never_folds, .threads = threads});
        ASSERT_TRUE(verify(tree));
        Cut cut(tree);
        EXPECT_EQ(borders(extract_mesh(cut)), borders(mesh));
        EXPECT_EQ(cut.triangle_count(), 4u * 230);
    }
}

TEST(Protection, HoldsWhateverIsAsked) {
    const Mesh mesh = terrain(24, 0);
    const VertexTree tree = built(mesh, {.border_weight = never_folds});
    const auto expected = borders(mesh);
    Cut cut(tree);
    const auto holds = [&] { return borders(extract_mesh(cut)) == expected; };
    EXPECT_TRUE(holds()) << "at first";
    EXPECT_EQ(cut.triangle_count(), tree.locked_triangles());
    cut.unfold_all();
    cut.fold_all();
    EXPECT_TRUE(holds() && !cut.fold(VertexTree::root()));
    const auto all_fold = [](const VertexTree&, std::span<const NodeId>, std::span<float> costs) {
        std::ranges::fill(costs, 0.0f);
    };
    EXPECT_EQ(cut.adjust(all_fold).triangles, tree.locked_triangles());
    EXPECT_EQ(cut.adjust(all_fold, Index{1}).triangles, tree.locked_triangles()) << "the least possible cut";
    EXPECT_TRUE(holds());
    const View view{.eye = {1, 2, 900}, .width = 500, .height = 500};
    for (const auto& criterion : {displacement(tree), *extent_criterion(tree, view, 30)}) {
        Viewpoint viewpoint = above(tree, 40);
        viewpoint.frusta = {{Plane{{0, 0, 1}, -1e6}}}; // which shows nothing
        for (int step = 0; step < 40; ++step) {
            viewpoint.eye += glm::dvec3(0.3, 0.1, step % 20 == 0 ? -300 : 0.1);
            viewpoint.eye_spread = step % 3 == 0 ? 0.03 : 0; // stereo
            if (step == 20) viewpoint.frusta.clear();
            for (const FollowOptions& options :
                 {FollowOptions{.cull_back_faces = true}, FollowOptions{.triangle_budget = 150, .hysteresis = 1.2f},
                  FollowOptions{.triangle_budget = 3}, FollowOptions{.threshold = 1e9f}}) {
                const auto stats = require(cut.follow(criterion, viewpoint, options));
                EXPECT_LE(stats->triangles, options.triangle_budget
                                                ? std::max(*options.triangle_budget, tree.locked_triangles())
                                                : tree.triangle_count());
                ASSERT_TRUE(holds()) << step;
            }
        }
    }
}

TEST(Protection, KeepsScenesWithinTheirBudget) {
    const VertexTree tree = built(terrain(16, 0), {.border_weight = never_folds}), sphere = built(shapes::icosphere(3));
    Cut a(sphere), b(tree), c(tree);
    const auto stats = require(follow_scene(std::vector<SceneObject>{{a, displacement(sphere), above(sphere, 1.01)},
                                                                     {b, displacement(tree), above(tree, 1.01)},
                                                                     {c, displacement(tree), above(tree)}},
                                            300));
    EXPECT_LE(a.triangle_count() + b.triangle_count() + c.triangle_count(), 300u);
    EXPECT_GE(c.triangle_count(), tree.locked_triangles());
    EXPECT_GT(a.triangle_count() + b.triangle_count(), tree.locked_triangles()) << "the rest has what is left";
}

// Of a sphere's triangles in the upper half, how many are left.
std::size_t upper(const Mesh& mesh) {
    return static_cast<std::size_t>(std::ranges::count_if(mesh.triangles, [&](const Triangle& t) {
        return std::ranges::all_of(t, [&](Index v) { return mesh.positions[v].z >= 0; });
    }));
}

TEST(Protection, WeightsOrderWhatIsKept) {
    Mesh mesh = shapes::bumpy_sphere(5);
    for (const ClustererKind clusterer : {ClustererKind::quadric, ClustererKind::octree}) {
        std::vector<std::size_t> by_budget, by_threshold;
        for (const float weight : {1.0f, 2.0f, 4.0f, 16.0f, never_folds}) {
            mesh.weights.clear();
            for (const glm::dvec3& p : mesh.positions) mesh.weights.push_back(p.z >= 0 ? weight : 1);
            const VertexTree tree = built(mesh, {.clusterer = clusterer});
            ASSERT_TRUE(verify(tree));
            const Index budget = static_cast<Index>(0.6 * static_cast<double>(mesh.triangles.size()));
            Cut cut(tree);
            ASSERT_TRUE(cut.follow(displacement(tree), above(tree, 100), {.triangle_budget = budget}));
            EXPECT_LE(cut.triangle_count(), budget);
            by_budget.push_back(upper(extract_mesh(cut)));
            ASSERT_TRUE(cut.follow(displacement(tree), above(tree, 100)));
            by_threshold.push_back(upper(extract_mesh(cut)));
        }
        EXPECT_TRUE(std::ranges::is_sorted(by_budget)) << ::testing::PrintToString(by_budget);
        EXPECT_TRUE(std::ranges::is_sorted(by_threshold)) << ::testing::PrintToString(by_threshold);
        EXPECT_GT(by_budget[2], by_budget[0] * 5 / 4);
        EXPECT_GT(by_threshold[2], by_threshold[0] * 5 / 4);
        EXPECT_EQ(by_budget[4], upper(mesh)) << "every triangle";
        EXPECT_EQ(by_threshold[4], upper(mesh));
    }
}

TEST(Protection, OfNothingCostsNothing) {
    const support::TempFolder folder;
    Mesh mesh = shapes::cube(8);
    ASSERT_TRUE(write_tree(folder / "b.vdt", built(mesh)));
    mesh.weights.assign(mesh.positions.size(), 1);
    ASSERT_TRUE(write_tree(folder / "a.vdt", built(mesh, {.border_weight = never_folds}))) << "edges are no borders";
    EXPECT_EQ(support::read_bytes(folder / "a.vdt"), support::read_bytes(folder / "b.vdt"));
}

TEST(Protection, OfEverythingLeavesEverything) {
    for (const std::size_t folding : {0, 1, 2}) {
        Mesh mesh = shapes::icosphere(1);
        mesh.weights.assign(mesh.positions.size(), never_folds);
        std::fill_n(mesh.weights.begin(), folding, 5.0f);
        const VertexTree tree = built(mesh);
        ASSERT_TRUE(verify(tree));
        Cut cut(tree);
        ASSERT_TRUE(cut.follow(displacement(tree), above(tree, 1e6)));
        EXPECT_GE(cut.triangle_count(), mesh.triangles.size() - folding * folding / 2 * 2);
    }
}

TEST(Protection, LivesInFiles) {
    const support::TempFolder folder;
    Mesh mesh = terrain(8, 0);
    mesh.weights.assign(mesh.positions.size(), 3);
    const VertexTree tree = built(mesh, {.border_weight = never_folds});
    ASSERT_TRUE(write_tree(folder / "tree.vdt", tree));
    for (const auto& again : {read_tree(folder / "tree.vdt"), map_tree(folder / "tree.vdt")}) {
        ASSERT_TRUE(again) << again.error().message;
        EXPECT_THAT(again->fold_weights(), ::testing::ElementsAreArray(tree.fold_weights()));
        EXPECT_EQ(borders(extract_mesh(Cut(*again))), borders(mesh));
    }
}

TEST(Protection, RefusesWrongWeights) {
    Mesh mesh = shapes::icosphere(1);
    for (const float bad : {0.0f, 0.5f, -1.0f, 1001.0f, std::numeric_limits<float>::quiet_NaN()}) {
        mesh.weights.clear();
        EXPECT_THAT(build_tree(mesh.view(), {.border_weight = bad}).error().message,
                    HasSubstr("The weight of borders"));
        mesh.weights.assign(mesh.positions.size(), 1);
        mesh.weights[7] = bad;
        EXPECT_THAT(build_tree(mesh.view()).error().message, HasSubstr("The weight of vertex 7 of the mesh must be"));
    }
    mesh.weights = {1, 2};
    EXPECT_THAT(build_tree(mesh.view()).error().message, HasSubstr("2 weights for 42 vertices"));
}

} // namespace unseen::vdtree::protection_test
