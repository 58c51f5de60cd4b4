// Whole runs that must come to the same: the scene moved, scaled, turned or renumbered, the eye a bit aside, a view
// that stands still, and a path that closes. Each run goes from a mesh to the cuts that the perceptual fold test makes
// along a path. The entries of docs/numerics.md by these names say what may differ.

#include <unseen/perception/criterion.h>
#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>

#include "built.h"
#include "measured.h"
#include "shapes.h"
#include "testing.h"
#include "tree_checks.h"

namespace unseen::perception::metamorphic_test {

using namespace vdtree;
using shapes::random_between;
using shapes::random_direction;
using support::measured;

// Coordinates that shifts by whole metres, up to 1e7 of them, leave exact.
constexpr double grid_step = 0x1p-20;
glm::dvec3 on_grid(glm::dvec3 p) { return glm::round(p / grid_step) * grid_step; }

Mesh ball() {
    Mesh mesh = shapes::bumpy_sphere(4);
    for (glm::dvec3& p : mesh.positions) p = on_grid(p);
    return mesh;
}
VertexTree measured_tree(const Mesh& mesh) { return measured(support::built(mesh, {.crease = 180})); }
View view_from(glm::dvec3 eye) { return {.eye = eye, .target = glm::dvec3(0), .up = {0.1, 1, 0.2}}; }
std::vector<View> path(int frames) {
    std::vector<View> views;
    for (int i = 0; i < frames; ++i) {
        const double angle = 2 * std::numbers::pi * i / frames;
        views.push_back(view_from(on_grid((8 + 3 * std::sin(2 * angle)) *
                                          glm::dvec3(std::sin(angle), 0.3 * std::sin(angle), std::cos(angle)))));
    }
    return views;
}
View moved(View view, const Similarity& by) {
    view.eye = by.to_world(view.eye), view.target = by.to_world(view.target), view.up = by.rotation * view.up;
    return view;
}

FoldTestOptions options_for(const View& view) { return {.gaze_px = glm::dvec2(1.3 * view.width, 0.5 * view.height)}; }
DistanceCriterion criterion_of(const VertexTree& tree) {
    return std::move(*require(error_distances(tree, View{}, options_for(View{}))));
}

// Each frame's decisions, one after the other.
std::vector<bool> decisions_at(const VertexTree& tree, const DistanceCriterion& criterion,
                               std::span<const Viewpoint> viewpoints) {
    Cut cut(tree);
    std::vector<bool> all;
    for (const Viewpoint& viewpoint : viewpoints) {
        const auto stats = require(cut.follow(criterion, viewpoint));
        for (NodeId node = 0; node < tree.interior_count(); ++node) all.push_back(cut.is_wanted(node));
    }
    return all;
}
std::vector<bool> decisions(const VertexTree& tree, const DistanceCriterion& criterion, std::span<const View> views,
                            const Similarity& placement) {
    std::vector<Viewpoint> viewpoints;
    for (const View& view : views) {
        const View there = moved(view, placement);
        viewpoints.push_back(viewpoint_of(tree, there, options_for(there), placement));
    }
    return decisions_at(tree, criterion, viewpoints);
}
double share_that_differs(const std::vector<bool>& a, const std::vector<bool>& b) {
    EXPECT_EQ(a.size(), b.size());
    std::size_t differ = 0;
    for (std::size_t i = 0; i < a.size() && i < b.size(); ++i) differ += a[i] != b[i];
    return static_cast<double>(differ) / static_cast<double>(a.size());
}
double share_unfolded(const std::vector<bool>& of) {
    return static_cast<double>(std::ranges::count(of, true)) / static_cast<double>(of.size());
}

// Of all decisions, where rounding moves the eye.
constexpr double most_differ = 1e-4;

// Made once for all tests.
struct Metamorphic : testing::Test {
    struct Run {
        VertexTree tree = measured_tree(ball());
        DistanceCriterion criterion = criterion_of(tree);
        std::vector<View> views = path(12);
        std::vector<bool> plain = decisions(tree, criterion, views, {});
    };
    static const Run& run() {
        static const Run made;
        return made;
    }
    const VertexTree& tree = run().tree;
    const DistanceCriterion& criterion = run().criterion;
    const std::vector<View>& views = run().views;
    const std::vector<bool>& plain = run().plain;

    Metamorphic() { // there is something to decide
        EXPECT_GT(share_unfolded(plain), 0.05);
        EXPECT_LT(share_unfolded(plain), 0.95);
    }
};

TEST_F(Metamorphic, TranslatingByTenMillionMetres) {
    for (const glm::dvec3& shift : {glm::dvec3(1e7, -1e7, 1e7), glm::dvec3(1, 1e7, 5e5)})
        EXPECT_EQ(share_that_differs(plain, decisions(tree, criterion, views, {.translation = shift})), 0);
    EXPECT_LE(share_that_differs(plain, decisions(tree, criterion, views, {.translation = glm::dvec3(1e7 / 3)})),
              most_differ);
    // Eyes in floats of the world would differ by half a metre.
    const glm::dvec3 shift(1e7, -1e7, 1e7);
    std::vector<Viewpoint> naive;
    for (const View& view : views) {
        View rounded = view;
        rounded.eye = glm::dvec3(glm::vec3(view.eye + shift)) - shift;
        naive.push_back(viewpoint_of(tree, rounded, options_for(rounded)));
    }
    EXPECT_GT(share_that_differs(plain, decisions_at(tree, criterion, naive)), 10 * most_differ);

    // The mesh itself, there: its tree has another origin, and with it other roundings of spheres.
    Mesh mesh = ball();
    for (glm::dvec3& p : mesh.positions) p += shift;
    const VertexTree there = measured_tree(mesh);
    ASSERT_EQ(there.interior_count(), tree.interior_count());
    std::vector<View> views_there;
    for (const View& view : views) views_there.push_back(moved(view, {.translation = shift}));
    EXPECT_LE(share_that_differs(plain, decisions(there, criterion_of(there), views_there, {})), most_differ);
}

TEST_F(Metamorphic, ScalingByAMillionthToAMillion) {
    for (const double scale : {0x1p-20, 0x1p-3, 0x1p7, 0x1p20})
        EXPECT_EQ(share_that_differs(plain, decisions(tree, criterion, views, {.scale = scale})), 0) << scale;
    for (const double scale : {1e-6, 1e-3, 0.3, 7.0, 1e3, 1e6})
        EXPECT_LE(share_that_differs(plain, decisions(tree, criterion, views, {.scale = scale})), most_differ) << scale;
    // The mesh itself in other units.
    for (const double scale : {1e-6, 0x1p-20, 0x1p7, 0x1p20, 1e6}) {
        const VertexTree scaled = measured_tree(shapes::placed(ball(), scale));
        std::vector<View> scaled_views;
        for (const View& view : views) scaled_views.push_back(moved(view, {.scale = scale}));
        ASSERT_EQ(scaled.interior_count(), tree.interior_count());
        // Lengths are classed by their logarithms, whose rounding differs where these are large: seldom, but it does.
        const bool is_power_of_two = std::exp2(std::round(std::log2(scale))) == scale && scale > 1e-6;
        EXPECT_LE(share_that_differs(plain, decisions(scaled, criterion_of(scaled), scaled_views, {})),
                  is_power_of_two ? 0 : most_differ)
            << scale;
    }
}

TEST_F(Metamorphic, Rotating) {
    std::mt19937_64 random(1);
    for (int round = 0; round < 8; ++round) {
        const Similarity turn{.rotation = glm::angleAxis(random_between(random, 0, 6), random_direction(random))};
        EXPECT_LE(share_that_differs(plain, decisions(tree, criterion, views, turn)), most_differ) << round;
        const Similarity all{random_between(random, 0.1, 10), turn.rotation, 1e7 * random_direction(random)};
        EXPECT_LE(share_that_differs(plain, decisions(tree, criterion, views, all)), most_differ) << round;
    }
}

TEST_F(Metamorphic, PermutingVerticesAndFaces) {
    std::mt19937_64 random(2);
    const Mesh mesh = ball();
    Mesh permuted = mesh;
    std::vector<Index> place(mesh.positions.size());
    std::iota(place.begin(), place.end(), Index{0});
    std::ranges::shuffle(place, random);
    for (std::size_t v = 0; v < place.size(); ++v) permuted.positions[place[v]] = mesh.positions[v];
    for (Triangle& t : permuted.triangles) {
        for (Index& corner : t) corner = place[corner];
        std::rotate(t.begin(), t.begin() + random() % 3, t.end());
    }
    std::ranges::shuffle(permuted.triangles, random);
    const VertexTree other = measured_tree(permuted);
    EXPECT_EQ(support::fault_when_unfolded(other, permuted.view()), "");
    const DistanceCriterion of_other = criterion_of(other);
    for (const View& view : views) {
        Cut a(tree), b(other);
        const auto in_a = a.follow(criterion, viewpoint_of(tree, view, options_for(view)));
        const auto in_b = b.follow(of_other, viewpoint_of(other, view, options_for(view)));
        ASSERT_TRUE(in_a && in_b);
        // Equal errors are contracted in the order of the vertices' numbers, so the trees are not quite the same.
        constexpr double most_of_triangles = 0.005;
        EXPECT_NEAR(in_b->triangles, in_a->triangles, most_of_triangles * in_a->triangles);
    }
}

TEST_F(Metamorphic, ABitOfTheEyesPosition) {
    std::mt19937_64 random(3);
    std::size_t most = 0;
    for (int round = 0; round < 300; ++round) {
        Viewpoint from = viewpoint_of(tree, view_from(random_between(random, 5, 11) * random_direction(random)),
                                      options_for(View{}));
        Viewpoint to = from;
        const int axis = static_cast<int>(random() % 3);
        to.eye[axis] = std::nextafter(to.eye[axis], random() % 2 ? 1e9 : -1e9);
        const std::vector<bool> a = decisions_at(tree, criterion, {&from, 1}),
                                b = decisions_at(tree, criterion, {&to, 1});
        std::size_t differ = 0;
        for (std::size_t i = 0; i < a.size(); ++i) differ += a[i] != b[i];
        most = std::max(most, differ);
    }
    EXPECT_LE(most, 2u) << "nodes; such as are within a rounding of where they switch";
}

TEST_F(Metamorphic, AStillViewIsAFixedPoint) {
    for (const FollowOptions& options : {FollowOptions{}, FollowOptions{.triangle_budget = 1200},
                                         FollowOptions{.triangle_budget = 1200, .hysteresis = 1.5f}}) {
        Cut cut(tree);
        for (const View& view : views) {
            const Viewpoint viewpoint = viewpoint_of(tree, view, options_for(view));
            ASSERT_TRUE(cut.follow(criterion, viewpoint, options));
            const std::vector<NodeId> before(cut.indices().begin(), cut.indices().end());
            const std::uint64_t revision = cut.revision();
            for (int again = 0; again < 3; ++again) {
                const auto stats = require(cut.follow(criterion, viewpoint, options));
                EXPECT_EQ(stats->node_tests + stats->folds + stats->unfolds, 0u);
                EXPECT_TRUE(cut.changes().empty());
            }
            EXPECT_TRUE(std::ranges::equal(cut.indices(), before)) << "in the same order";
            EXPECT_EQ(cut.revision(), revision);
        }
    }
}

TEST_F(Metamorphic, AClosedCameraPath) {
    const std::vector<View> round = path(360);
    struct Case {
        FollowOptions options;
        float factor; // of the least largest cost
    };
    for (const Case& c :
         {Case{{}, 1}, Case{{.triangle_budget = 1200}, 1}, Case{{.triangle_budget = 1200, .hysteresis = 1.5f}, 1.5f}}) {
        Cut cut(tree), least(tree);
        const Viewpoint start = viewpoint_of(tree, round[0], options_for(round[0]));
        const auto at_start = require(cut.follow(criterion, start, c.options));
        const auto before = support::sorted_triangles(cut);
        FollowOptions best = c.options;
        best.hysteresis = 1;
        const auto at_least = require(least.follow(criterion, start, best));
        for (const View& view : round)
            ASSERT_TRUE(cut.follow(criterion, viewpoint_of(tree, view, options_for(view)), c.options));
        const auto at_end = require(cut.follow(criterion, start, c.options));
        if (c.factor == 1) EXPECT_EQ(support::sorted_triangles(cut), before);
        const auto costs = require(find_every_cost(tree, criterion, start, c.options));
        float largest = 0;
        for (NodeId node = 0; node < tree.interior_count(); ++node)
            if (cut.is_active(node)) largest = std::max(largest, (*costs)[node]);
        EXPECT_LE(largest, at_end->max_fold_cost * (1 + 1e-5f)) << "an upper bound";
        EXPECT_LE(largest, c.factor * at_least->max_fold_cost * (1 + 1e-5f));
    }
}

} // namespace unseen::perception::metamorphic_test
