// The geometric criteria and the frustum test, against brute force, up the tree, and under similarity transforms.
#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/internal/footprint.h>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/depth_picture.h>
#include <unseen/vdtree/internal/normal_mask.h>

#include "shapes.h"
#include "sound.h"
#include "testing.h"
#include "tree_checks.h"

namespace unseen::vdtree::criteria_test {

using shapes::random_between;
using shapes::random_direction;
using shapes::random_unit;

// Of a cost: it is a float made from doubles.
constexpr double cost_rounding = 1e-6;

VertexTree built(const Mesh& mesh, ClustererKind kind = ClustererKind::quadric) {
    return std::move(*require(build_tree(mesh.view(), {.clusterer = kind})));
}

using MakeCriterion = Result<DistanceCriterion> (*)(const VertexTree&, const View&, double tolerance_pixels);

std::vector<float> costs_of(MakeCriterion make, const VertexTree& tree, const View& view, double tolerance,
                            const Similarity& placement = {}) {
    const auto criterion = require(make(tree, view, tolerance));
    EXPECT_TRUE(criterion->is_monotone());
    const auto costs = require(find_every_cost(tree, *criterion, {.eye = eye_in_tree(tree, view, placement)}));
    return *costs;
}

// Costs are ratios of distances. The pixels that they stand for, by the formulas of both criteria:
double extent_pixels(float cost, const View& view, double tolerance) {
    const double switch_distance = 1 / std::sin(tolerance / pixels_per_radian(view) / 2) - 1,
                 radius_over_gap = static_cast<double>(cost) / switch_distance;
    return 2 * std::asin(radius_over_gap / (1 + radius_over_gap)) * pixels_per_radian(view);
}
double displacement_pixels(float cost, const View& view, double tolerance) {
    const double half = static_cast<double>(cost) * std::sin(tolerance / pixels_per_radian(view) / 2);
    return 2 * std::asin(std::min(1.0, half)) * pixels_per_radian(view);
}
// Tolerances of half a turn and more fold whatever the eye is not in.
bool is_less_than_a_turn(const View& view, double tolerance) { return tolerance / pixels_per_radian(view) < 3; }

// By node: whether the view's frustum leaves it unfolded under a criterion that folds nothing else.
std::vector<bool> seen_of(const VertexTree& tree, const View& view, const Similarity& placement = {}) {
    const auto criterion = DistanceCriterion::create(tree, {.lengths = std::vector<float>(tree.interior_count(), 1.0f),
                                                            .switch_distance = {DistanceCriterion::always_visible}});
    const auto bits = test_every_node(tree, *criterion, viewpoint_of(tree, view, placement));
    std::vector<bool> seen;
    if (!bits) return seen; // of the largest meshes some views are too far away
    for (NodeId node = 0; node < tree.interior_count(); ++node) seen.push_back((*bits)[node / 64] >> (node % 64) & 1);
    return seen;
}

// From inside the model to far away.
View random_view(std::mt19937_64& random, const VertexTree& tree) {
    const Sphere ball = tree.bounding_sphere();
    const glm::dvec3 centre = tree.origin() + glm::dvec3(ball.centre);
    View view;
    view.eye = centre + std::pow(10.0, random_between(random, -1, 2)) * static_cast<double>(ball.radius) *
                            random_direction(random);
    view.target = centre + 0.5 * static_cast<double>(ball.radius) * random_direction(random);
    view.up = random_direction(random);
    view.fov_y_degrees = random_between(random, 5, 140);
    view.width = 1 + static_cast<int>(random() % 2000);
    view.height = 1 + static_cast<int>(random() % 2000);
    return validate(view) ? view : random_view(random, tree);
}

Similarity random_similarity(std::mt19937_64& random) {
    Similarity s;
    s.scale = std::pow(10.0, random_between(random, -4, 4));
    s.rotation = glm::angleAxis(random_between(random, -3, 3), random_direction(random));
    s.translation = 3.0 * random_direction(random);
    return s;
}

View moved(const View& view, const Similarity& s) {
    View out = view;
    out.eye = s.to_world(view.eye);
    out.target = s.to_world(view.target);
    out.up = s.rotation * view.up;
    return out;
}

const std::vector<shapes::Named>& meshes() {
    static const std::vector<shapes::Named> all = {
        {"bumpy sphere", shapes::bumpy_sphere(3)},
        {"spiky star", shapes::spiky_star(2)},
        {"unwelded torus", shapes::unwelded(shapes::torus(12, 7))},
        {"soup", shapes::random_soup(100, 300, 3)},
        {"northing", shapes::placed(shapes::bumpy_sphere(2), 30, {5e5, 5e6, 100})},
        {"tiny", shapes::placed(shapes::bumpy_sphere(2), 1e-19)},
        {"huge", shapes::placed(shapes::bumpy_sphere(2), 1e30)},
        {"seam", shapes::seam(true)},
    };
    return all;
}

// But for those beyond what distances in floats reach.
std::vector<shapes::Named> meshes_in_range() {
    std::vector<shapes::Named> named = meshes();
    std::erase_if(named, [](const shapes::Named& n) { return n.name == "huge" || n.name == "tiny"; });
    return named;
}

TEST(PixelsPerRadian, IsThatOfTheWindowsCentre) {
    // 90 degrees over 1000 pixels: half the height at distance 1 is 1.
    EXPECT_NEAR(pixels_per_radian({.fov_y_degrees = 90, .height = 1000}), 500, 1e-9);
    // A small object at the centre: its height in pixels, projected by hand.
    const View view{.eye = {0, 0, 10}, .fov_y_degrees = 37, .height = 768};
    const double half = 1e-4, tan_y = std::tan(37 * std::numbers::pi / 360);
    const double pixels = 2 * half / 10 / tan_y * 768 / 2;
    EXPECT_NEAR(pixels_per_radian(view) * 2 * half / 10, pixels, 1e-9 * pixels);
}

TEST(EyeInTree, UndoesThePlacementAndTheOrigin) {
    std::mt19937_64 random(1);
    const VertexTree tree = built(shapes::placed(shapes::icosphere(1), 3, {5e5, 5e6, 7}));
    for (int round = 0; round < 100; ++round) {
        const Similarity s = random_similarity(random);
        const glm::dvec3 p = tree.origin() + 5.0 * random_direction(random);
        const View view{.eye = s.to_world(p)};
        // The northing costs seven of a double's sixteen digits.
        EXPECT_LT(glm::distance(eye_in_tree(tree, view, s), p - tree.origin()), 1e-8);
    }
}

TEST(Extent, IsTheSizeOfTheProjectedSphere) {
    std::mt19937_64 random(2);
    const VertexTree tree = built(shapes::bumpy_sphere(2));
    for (int round = 0; round < 20; ++round) {
        View view = random_view(random, tree);
        const double tolerance = random_between(random, 0.5, 20);
        if (!is_less_than_a_turn(view, tolerance)) continue;
        const auto costs = costs_of(extent_criterion, tree, view, tolerance);
        for (NodeId node = 0; node < tree.interior_count(); node += 7) {
            const Sphere s = tree.support_spheres()[node];
            const glm::dvec3 centre = tree.origin() + glm::dvec3(s.centre), to_centre = centre - view.eye;
            if (glm::length(to_centre) <= s.radius) {
                EXPECT_TRUE(is_unbounded(costs[node]));
                continue;
            }
            if (s.radius == 0) continue;
            // The widest angle from the centre's direction to a point of the sphere, by walking a great circle
            // through it.
            const glm::dvec3 back = -glm::normalize(to_centre),
                             side = glm::normalize(glm::cross(back, random_direction(random)));
            double widest = 0;
            for (int i = 0; i < 20'000; ++i) {
                const double a = std::numbers::pi * i / 20'000;
                const glm::dvec3 p =
                    to_centre + static_cast<double>(s.radius) * (std::cos(a) * back + std::sin(a) * side);
                widest = std::max(widest, std::atan2(glm::length(glm::cross(p, back)), -glm::dot(p, back)));
            }
            const double pixels = 2 * widest * pixels_per_radian(view);
            const double distance = glm::length(to_centre),
                         near = distance / (distance - s.radius); // rounding of distances
            ASSERT_NEAR(extent_pixels(costs[node], view, tolerance), pixels, 1e-4 * near * pixels);
        }
    }
}

TEST(Extent, IsZeroForAPoint) {
    Mesh mesh = shapes::cube(1);
    const Index first = static_cast<Index>(mesh.positions.size());
    for (int k = 0; k < 3; ++k) mesh.positions.push_back(glm::dvec3(0.5) + 1e-10 * glm::dvec3(k, k * k, 0));
    mesh.triangles.push_back({first, first + 1, first + 2}); // one point in floats
    const VertexTree tree = built(mesh);
    const auto costs = costs_of(extent_criterion, tree, {.eye = {0, 0, 5}}, 1);
    int points = 0;
    for (NodeId node = 0; node < tree.interior_count(); ++node) {
        if (tree.support_spheres()[node].radius > 0) continue;
        EXPECT_EQ(costs[node], 0);
        ++points;
    }
    EXPECT_GT(points, 0);
}

TEST(Displacement, IsNotExceededByTheEye) {
    // From close by, a movement across the line of sight fills more than a right angle:
    //
    //   eye .     A proxy at A; the vertex B moves all the way across. C makes the sphere that of radius 1.
    //     A---B
    //     \   /
    //       C       The other two vertices are far below.
    Mesh mesh;
    const double h = std::sqrt(0.5);
    mesh.positions = {{-h, 0, h}, {h, 0, h}, {0, 0, -1}, {0, 0, -9}, {1, 0, -9}};
    mesh.triangles = {{0, 1, 3}, {2, 3, 4}};
    const auto cluster = [](const ClusterInput& input) {
        const auto& p = input.mesh.positions;
        return Result<Clustering>(Clustering{{5, 5, 5, 6, 6, 6, 6}, {p[0], p[3]}});
    };
    const auto tree = require(build_tree(mesh.view(), cluster));
    const View view{.eye = {0, 0, 1.1}};
    const auto costs = costs_of(displacement_criterion, *tree, view, 1);
    const double angle = 2 * std::atan(h / (1.1 - h)); // between A and B
    EXPECT_GT(angle, std::numbers::pi / 2);
    EXPECT_FALSE(is_unbounded(costs[1]));
    EXPECT_GE(displacement_pixels(costs[1], view, 1) * (1 + 1e-5), angle * pixels_per_radian(view));
}

TEST(Displacement, IsTheMovementSeenFromTheNearestPoint) {
    std::mt19937_64 random(4);
    const VertexTree tree = built(shapes::bumpy_sphere(2));
    View view{.eye = {0, 0, 50}}; // far away, where angles are small
    const auto costs = costs_of(displacement_criterion, tree, view, 2);
    for (NodeId node = 0; node < tree.interior_count(); ++node) {
        const Sphere s = tree.support_spheres()[node];
        const double nearest = glm::distance(view.eye, tree.origin() + glm::dvec3(s.centre)) - s.radius;
        const double pixels = tree.displacement()[node] / nearest * pixels_per_radian(view);
        EXPECT_NEAR(displacement_pixels(costs[node], view, 2), pixels, 1e-3 * pixels);
    }
}

TEST(Displacement, IsUnboundedInsideWhereTheSurfaceMoves) {
    const VertexTree tree = built(shapes::seam(true));
    const auto outside = costs_of(displacement_criterion, tree, {.eye = {0, 0, 5}}, 1);
    const glm::dvec3 middle = tree.origin() + glm::dvec3(tree.support_spheres()[0].centre);
    const auto inside = costs_of(displacement_criterion, tree, {.eye = middle}, 1);
    EXPECT_TRUE(is_unbounded(inside[0]));
    EXPECT_FALSE(is_unbounded(outside[0]));
    for (NodeId node = 0; node < tree.interior_count(); ++node) {
        if (tree.displacement()[node] > 0) continue;
        EXPECT_EQ(outside[node], 0);
        EXPECT_EQ(inside[node], 0);
    }
}

TEST(Criteria, DoNotFallFromANodeToItsParent) {
    std::mt19937_64 random(5);
    for (const shapes::Named& named : meshes_in_range()) {
        for (const ClustererKind kind : {ClustererKind::quadric, ClustererKind::octree}) {
            SCOPED_TRACE(named.name + ", " + std::string(name(kind)));
            const VertexTree tree = built(named.mesh, kind);
            const SoundTree sound = support::sound(tree);
            const auto parents = sound.parents();
            for (int round = 0; round < 200; ++round) {
                const View view = random_view(random, tree);
                const glm::dvec3 eye = eye_in_tree(tree, view, {});
                for (const MakeCriterion make : {&extent_criterion, &displacement_criterion}) {
                    const auto costs = costs_of(make, tree, view, 3);
                    for (NodeId node = 1; node < tree.interior_count(); ++node) {
                        const Sphere s = tree.support_spheres()[node];
                        const double distance = glm::length(glm::dvec3(s.centre) - eye);
                        if (std::abs(distance - s.radius) < 1e-3 * distance) continue; // on the sphere but for rounding
                        ASSERT_GE(costs[parents[node]] * (1 + 2e-3f), costs[node])
                            << "node " << node << ", round " << round;
                    }
                }
            }
        }
    }
}

TEST(Criteria, AreNumbersForTiniestMeshesAndRefuseEyesTooFarForFloats) {
    std::mt19937_64 random(7);
    for (const shapes::Named& named : meshes()) {
        const VertexTree tree = built(named.mesh);
        for (int round = 0; round < 50; ++round) {
            const View view = random_view(random, tree);
            for (const MakeCriterion make : {&extent_criterion, &displacement_criterion}) {
                const auto costs = find_every_cost(tree, *make(tree, view, 3), {.eye = eye_in_tree(tree, view, {})});
                ASSERT_EQ(costs.has_value(), named.name != "huge");
                if (!costs) continue;
                for (const float cost : *costs) ASSERT_TRUE(cost >= 0) << named.name;
            }
        }
    }
}

TEST(Criteria, StayTheSameWhenEyeAndTreeMoveTogether) {
    std::mt19937_64 random(8);
    for (const shapes::Named& named : {meshes()[0], meshes()[1]}) {
        SCOPED_TRACE(named.name);
        const VertexTree tree = built(named.mesh);
        for (int round = 0; round < 40; ++round) {
            const View view = random_view(random, tree);
            Similarity s = random_similarity(random);
            s.translation *= s.scale * tree.bounding_sphere().radius; // beside the model, whatever its size
            const View there = moved(view, s);
            const auto compare = [&](const std::vector<float>& a, const std::vector<float>& b) {
                for (std::size_t i = 0; i < a.size(); ++i) {
                    const Sphere sphere = tree.support_spheres()[i];
                    const double distance = glm::length(glm::dvec3(sphere.centre) - eye_in_tree(tree, view, {}));
                    if (std::abs(distance - sphere.radius) < 1e-2 * distance)
                        continue; // an eye on a sphere may fall to either side
                    if (is_unbounded(a[i])) ASSERT_TRUE(is_unbounded(b[i])) << "node " << i;
                    else ASSERT_NEAR(a[i], b[i], 1e-4 * a[i] + 1e-6) << "node " << i;
                }
            };
            for (const MakeCriterion make : {&extent_criterion, &displacement_criterion})
                compare(costs_of(make, tree, view, 2), costs_of(make, tree, there, 2, s));
            const auto here = seen_of(tree, view), elsewhere = seen_of(tree, there, s);
            int different = 0;
            for (std::size_t i = 0; i < here.size(); ++i) different += here[i] != elsewhere[i];
            ASSERT_LE(different, 1); // a sphere that touches a plane may fall to either side
        }
    }
}

TEST(Criteria, FoldFromHalfAsFarWithTwiceTheTolerance) {
    const VertexTree tree = built(shapes::bumpy_sphere(2));
    const View view{.eye = {0, 2, 5}};
    for (const MakeCriterion make : {&extent_criterion, &displacement_criterion}) {
        const auto one = costs_of(make, tree, view, 1), two = costs_of(make, tree, view, 2);
        for (std::size_t i = 0; i < one.size(); ++i)
            EXPECT_NEAR(one[i], 2 * two[i], 2e-3 * one[i]); // but for the spheres' own radii
    }
}

// A node, and an eye where its support's sphere is.
struct EyeAtSphere {
    NodeId node;
    glm::dvec3 eye; // in the tree's frame
};

// Inside of spheres, and exactly on them: where radius and centre add up without rounding, also in floats.
std::vector<EyeAtSphere> eyes_at_spheres(const VertexTree& tree, bool on_the_sphere) {
    std::vector<EyeAtSphere> eyes;
    for (NodeId node = 0; node < tree.interior_count(); ++node) {
        const Sphere s = tree.support_spheres()[node];
        if (!(s.radius > 0) || !(tree.displacement()[node] > 0)) continue;
        for (int axis = 0; axis < 3; ++axis) {
            glm::vec3 eye = s.centre;
            eye[axis] += on_the_sphere ? s.radius : s.radius / 4;
            if (!on_the_sphere || eye[axis] - s.centre[axis] == s.radius) eyes.push_back({node, glm::dvec3(eye)});
        }
    }
    return eyes;
}

// The definition of a budget, a node at a time: the largest cost first, none larger than its parent's, ties by number.
std::vector<bool> best_within(const VertexTree& tree, std::vector<float> costs, Index budget) {
    const SoundTree sound = support::sound(tree);
    const auto parents = sound.parents(), first = sound.first_triangle();
    for (NodeId node = 1; node < tree.interior_count(); ++node)
        costs[node] = std::min(costs[node], costs[parents[node]]);
    std::vector<bool> unfolded(tree.interior_count());
    for (;;) {
        NodeId best = no_node;
        for (NodeId node = 0; node < tree.interior_count(); ++node)
            if (!unfolded[node] && costs[node] > 0 && (node == 0 || unfolded[parents[node]]) &&
                (best == no_node || costs[node] > costs[best]))
                best = node;
        if (best == no_node) return unfolded;
        unfolded[best] = true;
        Index triangles = 0;
        const std::vector<bool> drawn = support::with_needs(tree, unfolded);
        for (NodeId node = 0; node < tree.interior_count(); ++node)
            if (drawn[node]) triangles += first[node + 1] - first[node];
        if (triangles <= budget) continue;
        unfolded[best] = false;
        return unfolded;
    }
}

std::vector<bool> state_of(const Cut& cut) {
    std::vector<bool> unfolded(cut.tree().interior_count());
    for (NodeId node = 0; node < unfolded.size(); ++node) unfolded[node] = cut.is_wanted(node);
    return unfolded;
}

// Of the nodes at which a cut ends.
float largest_left(const VertexTree& tree, const std::vector<float>& costs, const std::vector<bool>& unfolded) {
    const SoundTree sound = support::sound(tree);
    float largest = 0;
    for (NodeId node = 0; node < tree.interior_count(); ++node)
        if (!unfolded[node] && (node == 0 || unfolded[sound.parents()[node]])) largest = std::max(largest, costs[node]);
    return largest;
}

TEST(InfiniteCosts, AreThoseOfEyesOnAndInSpheresHoweverTheCutIsMade) {
    constexpr Index few = 2;
    int tested = 0, infinite_left = 0;
    for (const shapes::Named& named : meshes_in_range()) {
        const VertexTree tree = built(named.mesh);
        const auto parents = support::sound(tree).parents();
        const glm::dvec3 far = glm::dvec3(tree.bounding_sphere().centre) + glm::dvec3(0, 0, 50);
        for (const MakeCriterion make : {&extent_criterion, &displacement_criterion}) {
            const auto criterion = require(make(tree, View{}, 3));
            Cut followed(tree);
            for (const bool on_the_sphere : {false, true}) {
                const auto eyes = eyes_at_spheres(tree, on_the_sphere);
                for (std::size_t i = 0; i < eyes.size(); i += 1 + eyes.size() / 20) {
                    const auto& [node, eye] = eyes[i];
                    const auto costs = require(find_every_cost(tree, *criterion, {.eye = eye}));
                    EXPECT_EQ((*costs)[node], std::numeric_limits<float>::infinity())
                        << named.name << ", node " << node;
                    for (const float cost : *costs) ASSERT_FALSE(std::isnan(cost)) << named.name;

                    // From the root down, and on from a cut for an eye far away.
                    Cut fresh(tree);
                    ASSERT_TRUE(fresh.follow(*criterion, {.eye = eye}));
                    ASSERT_TRUE(followed.follow(*criterion, {.eye = far}));
                    ASSERT_TRUE(followed.follow(*criterion, {.eye = eye}));
                    for (NodeId up = node; up != no_node; up = parents[up]) {
                        EXPECT_TRUE(fresh.is_unfolded(up)) << named.name << ", node " << up;
                        EXPECT_TRUE(followed.is_unfolded(up)) << named.name << ", node " << up;
                    }
                    // With too few triangles some of these nodes are left.
                    const float least = largest_left(tree, *costs, best_within(tree, *costs, few));
                    infinite_left += std::isinf(least);
                    for (const float hysteresis : {1.0f, 1.1f}) {
                        const auto stats =
                            fresh.follow(*criterion, {.eye = eye}, {.triangle_budget = few, .hysteresis = hysteresis});
                        ASSERT_TRUE(stats);
                        EXPECT_GE(stats->max_fold_cost, least) << named.name;
                        EXPECT_LE(stats->max_fold_cost, hysteresis * least) << named.name;
                    }
                    ++tested;
                }
            }
        }
    }
    EXPECT_GT(tested, 300);
    EXPECT_GT(infinite_left, 100);
}

// Merges vertices by their numbers, four at a time, wherever they are: so the spheres of most nodes overlap.
const auto cluster_by_number = [](const ClusterInput& input) {
    auto count = static_cast<Index>(input.mesh.positions.size());
    Clustering clustering{std::vector<Index>(count), {}};
    for (Index first = 0; count > 1;) {
        const Index next = first + count;
        for (Index i = 0; i < count; ++i) clustering.parents[first + i] = next + i / 4;
        first = next, count = (count + 3) / 4;
        clustering.parents.resize(first + count, first); // the root is its own parent
    }
    return Result<Clustering>(clustering);
};

TEST(InfiniteCosts, UnfoldFirstUnderABudgetAndInTheOrderOfNodes) {
    Mesh mesh = shapes::random_soup(128, 300, 3);
    for (glm::dvec3& p : mesh.positions) p.y = p.z = 0; // triangles of no area cannot turn over
    const auto made_tree = require(build_tree(mesh.view(), cluster_by_number));
    const VertexTree& tree = *made_tree;
    const Viewpoint viewpoint{.eye = glm::dvec3(tree.bounding_sphere().centre)};
    const auto criterion = require(extent_criterion(tree, View{}, 3));
    const auto costs = require(find_every_cost(tree, *criterion, viewpoint));
    const auto parents = support::sound(tree).parents();
    int cut_between_infinite_ones = 0;
    for (Index budget = 0; budget <= tree.triangle_count(); ++budget) {
        const FollowOptions options{.triangle_budget = budget};
        const std::vector<bool> wanted = best_within(tree, *costs, budget);
        // On several threads at once, a cut each.
        std::array<std::vector<bool>, 4> made;
        std::vector<std::thread> threads;
        for (auto& state : made)
            threads.emplace_back([&] {
                Cut cut(tree);
                if (cut.follow(*criterion, viewpoint, options)) state = state_of(cut);
            });
        for (std::thread& thread : threads) thread.join();
        for (const auto& state : made) ASSERT_EQ(state, wanted) << "budget " << budget;

        bool is_one_unfolded = false, is_one_left = false;
        for (NodeId node = 1; node < tree.interior_count(); ++node)
            if (std::isinf((*costs)[node]) && wanted[parents[node]])
                (wanted[node] ? is_one_unfolded : is_one_left) = true;
        cut_between_infinite_ones += is_one_unfolded && is_one_left;
    }
    EXPECT_GT(cut_between_infinite_ones, 10);
}

TEST(UnboundedCosts, AreUnbounded) {
    EXPECT_TRUE(is_unbounded(std::numeric_limits<float>::infinity()));
    EXPECT_TRUE(is_unbounded(std::numeric_limits<float>::quiet_NaN()));
    EXPECT_FALSE(is_unbounded(1e20f));
}

// Whether a point (relative to the tree's origin) is in front of the eye and within the window. The window's planes
// are moved outward by `play` of the point's distance from the eye.
bool in_window(const VertexTree& tree, const View& view, glm::dvec3 p, double play) {
    const CameraFrame f = camera_frame(view);
    const glm::dvec3 d = tree.origin() + p - view.eye;
    const double depth = -glm::dot(d, f.back), tan_y = std::tan(view.fov_y_degrees * std::numbers::pi / 360);
    const double tan_x = tan_y * view.width / view.height;
    const double slack = play * glm::length(d);
    return depth > -slack && std::abs(glm::dot(d, f.right)) < depth * tan_x + slack * std::hypot(1, tan_x) &&
           std::abs(glm::dot(d, f.up)) < depth * tan_y + slack * std::hypot(1, tan_y);
}

TEST(Frustum, AgreesWithPointsOfTheSpheres) {
    std::mt19937_64 random(9);
    int counts[2] = {0, 0};
    for (const shapes::Named& named : meshes()) {
        SCOPED_TRACE(named.name);
        const VertexTree tree = built(named.mesh);
        for (int round = 0; round < 30; ++round) {
            const View view = random_view(random, tree);
            const auto seen = seen_of(tree, view);
            for (NodeId node = 0; node < seen.size(); ++node) {
                ++counts[seen[node]];
                if (seen[node]) continue;
                const Sphere s = tree.bounds()[node].ring;
                for (int i = 0; i < 10; ++i) {
                    const glm::dvec3 p =
                        glm::dvec3(s.centre) + s.radius * (i == 0 ? 0.0 : 1.0) * random_direction(random);
                    ASSERT_FALSE(in_window(tree, view, p, -1e-9)) << "node " << node;
                }
            }
        }
    }
    for (const int count : counts) EXPECT_GT(count, 1000); // both happen
}

TEST(Frustum, IsTightForSmallSpheres) {
    std::mt19937_64 random(10);
    const VertexTree tree = built(shapes::bumpy_sphere(4));
    int out = 0, in = 0;
    for (int round = 0; round < 60; ++round) {
        View view = random_view(random, tree);
        if (round % 2) view.target += 3.0 * random_direction(random); // past the model
        const auto seen = seen_of(tree, view);
        for (NodeId node = 0; node < tree.interior_count(); ++node) {
            // A sphere that is small, as seen from the eye, and whose centre is far from the window's edges, is
            // decided.
            const Sphere s = tree.bounds()[node].ring;
            const double distance = glm::distance(tree.origin() + glm::dvec3(s.centre), view.eye);
            if (distance < 1e-6 || s.radius > 0.02 * distance) continue;
            if (in_window(tree, view, glm::dvec3(s.centre), -0.05)) {
                ASSERT_TRUE(seen[node]);
                ++in;
            } else if (!in_window(tree, view, glm::dvec3(s.centre), 0.05)) {
                ASSERT_FALSE(seen[node]);
                ++out;
            }
        }
    }
    EXPECT_GT(in, 100);
    EXPECT_GT(out, 100);
}

TEST(Frustum, NestsUpTheTree) {
    std::mt19937_64 random(11);
    for (const shapes::Named& named : meshes()) {
        const VertexTree tree = built(named.mesh);
        for (int round = 0; round < 100; ++round) {
            const auto seen = seen_of(tree, random_view(random, tree));
            for (NodeId node = 1; node < seen.size(); ++node)
                ASSERT_TRUE(!seen[node] || seen[support::sound(tree).parents()[node]]) << named.name << ", " << node;
        }
    }
}

TEST(Frustum, FoldsWhatIsBehindTheEye) {
    const VertexTree tree = built(shapes::bumpy_sphere(3));
    for (const bool seen : seen_of(tree, {.eye = {0, 0, 5}, .target = {0, 0, 9}})) EXPECT_FALSE(seen);
    EXPECT_TRUE(seen_of(tree, {.eye = {0, 0, 5}})[VertexTree::root()]);
}

// Whether the sphere shows in the window, from the definition: sides by the half space, conservatively.
bool may_show(const View& view, glm::dvec3 point) {
    const CameraFrame frame = camera_frame(view);
    const glm::dvec3 from = point - view.eye;
    if (view.orthographic_height)
        return std::abs(glm::dot(from, frame.up)) < 0.5 * *view.orthographic_height &&
               std::abs(glm::dot(from, frame.right)) < 0.5 * *view.orthographic_height * view.width / view.height;
    const Footprint at = Projector(view)(point);
    return at.nearest > 0 && at.left > 0 && at.top > 0 && at.right < view.width && at.bottom < view.height;
}

View shifted(View view, std::mt19937_64& random) {
    view.shift = {random_between(random, -3, 3), random_between(random, -3, 3)};
    return view;
}
View parallel(View view, std::mt19937_64& random, double height) {
    view.orthographic_height = height * std::pow(10.0, random_between(random, -2, 1));
    return view;
}

TEST(FrustumOf, HoldsAllThatShowsOffCentreAndInParallel) {
    std::mt19937_64 random(21);
    const VertexTree tree = built(shapes::bumpy_sphere(3));
    const double radius = tree.bounding_sphere().radius;
    int shown = 0, hidden = 0;
    for (int i = 0; i < 300; ++i) {
        const View centred = random_view(random, tree);
        const View view = i % 2 == 0 ? shifted(centred, random) : parallel(centred, random, radius);
        const Frustum frustum = frustum_of(tree, view);
        for (int k = 0; k < 40; ++k) {
            const glm::dvec3 point =
                tree.origin() + glm::dvec3(tree.position(static_cast<NodeId>(random() % tree.node_count())));
            double lowest = 1e300;
            for (const Plane& plane : frustum)
                lowest = std::min(lowest, glm::dot(plane.normal, point - tree.origin()) + plane.offset);
            if (may_show(view, point)) {
                EXPECT_GT(lowest, -1e-9);
                ++shown;
            } else {
                // Orthographic sides are farther out by a share of the eye's distance, for rounding.
                hidden += lowest < 0;
                const double out = view.orthographic_height ? 2.1e-3 * *view.orthographic_height + 1e-5 * radius : 1e-9;
                EXPECT_LT(lowest, out);
            }
        }
    }
    EXPECT_GT(shown, 300);
    EXPECT_GT(hidden, 300);
}

// In an orthographic view a ball of radius r is 2 r px high, wherever it is: nothing folds that is larger than the
// tolerance, and of what is a few per cent smaller nothing stays, where the window shows all of the tree.
TEST(Orthographic, FoldsBySizesThatDoNotFallWithTheDistance) {
    std::mt19937_64 random(22);
    const VertexTree tree = built(shapes::bumpy_sphere(4, 0.05));
    const double radius = tree.bounding_sphere().radius;
    for (int i = 0; i < 60; ++i) {
        View view = random_view(random, tree);
        view.width = view.height = 1000;
        view.orthographic_height = (i % 3 == 0 ? 2.2 : std::pow(10.0, random_between(random, -1, 1))) * radius;
        const double pixels_a_unit = view.height / *view.orthographic_height;
        const double tolerance = std::pow(10.0, random_between(random, 0, 2));
        for (const bool by_extent : {true, false}) {
            const auto criterion =
                by_extent ? extent_criterion(tree, view, tolerance) : displacement_criterion(tree, view, tolerance);
            ASSERT_TRUE(criterion);
            const auto bits = require(test_every_node(tree, *criterion, viewpoint_of(tree, view, {}, false)));
            for (NodeId node = 0; node < tree.interior_count(); ++node) {
                const double length = by_extent ? 2.0 * static_cast<double>(tree.support_spheres()[node].radius)
                                                : static_cast<double>(tree.displacement()[node]);
                const bool unfolded = (*bits)[node / 64] >> (node % 64) & 1;
                // Depth and spread: two diameters and two radii of 2000 windows, which the nearest may gain.
                const double gain = 1 + 8 * radius / (2000 * *view.orthographic_height);
                if (length * pixels_a_unit > tolerance * (1 + 1e-5)) EXPECT_TRUE(unfolded) << node;
                if (gain < 1.1 && length * pixels_a_unit * gain * 1.001 < tolerance) EXPECT_FALSE(unfolded) << node;
            }
        }
    }
}

// Facing: a criterion in which outlines alone are seen. All nodes whose ring has triangles that face both ways in the
// parallel view must be unfolded.
TEST(Orthographic, TakesAllOutlinesForOutlines) {
    std::mt19937_64 random(23);
    const VertexTree tree = built(shapes::bumpy_sphere(4, 0.05));
    DistanceCriterion::Parts parts;
    parts.classes.assign(tree.interior_count(), {0, 1});
    parts.switch_distance = {DistanceCriterion::never_visible, DistanceCriterion::always_visible};
    const auto criterion = require(DistanceCriterion::create(tree, std::move(parts)));
    std::size_t outlines = 0, all_kept = 0;
    for (int i = 0; i < 40; ++i) {
        View view = random_view(random, tree);
        view.orthographic_height = 2.2 * tree.bounding_sphere().radius;
        const auto bits = require(test_every_node(tree, *criterion, viewpoint_of(tree, view, {}, false)));
        const glm::dvec3 back = camera_frame(view).back;
        std::vector<std::uint8_t> sides(tree.interior_count());
        for (std::size_t t = 0; t < tree.triangle_count(); ++t) {
            glm::dvec3 corner[3];
            for (int k = 0; k < 3; ++k)
                corner[k] = glm::dvec3(tree.positions()[tree.wedge_of_leaf(support::sound(tree).triangles()[t][k])]);
            const double facing = glm::dot(glm::cross(corner[1] - corner[0], corner[2] - corner[0]), back);
            for (int k = 0; k < 3; ++k)
                for (NodeId node =
                         support::sound(tree).parents()[tree.place_of_leaf(support::sound(tree).triangles()[t][k])];
                     node != no_node; node = support::sound(tree).parents()[node])
                    sides[node] |= facing > 0 ? 1 : 2;
        }
        for (NodeId node = 0; node < tree.interior_count(); ++node) {
            const bool unfolded = (*bits)[node / 64] >> (node % 64) & 1;
            outlines += sides[node] == 3;
            all_kept += unfolded;
            if (sides[node] == 3) EXPECT_TRUE(unfolded) << node;
        }
    }
    EXPECT_GT(outlines, 100u);
    EXPECT_LT(all_kept, 40u * tree.interior_count()); // some are told to face one way
}

TEST(ViewpointOfPair, HoldsWhatEitherWindowShowsAndRefusesWhatIsNone) {
    const VertexTree tree = built(shapes::bumpy_sphere(3));
    View left{.eye = {-0.03, 0, 3}, .target = {-0.03, 0, 0}, .shift = {0.2, 0}};
    View right{.eye = {0.03, 0, 3}, .target = {0.03, 0, 0}, .shift = {-0.2, 0}};
    const auto pair = require(viewpoint_of_pair(tree, left, right, {.scale = 2}));
    EXPECT_EQ(pair->frusta.size(), 2u);
    EXPECT_NEAR(pair->eye_spread, 0.015, 1e-9); // mesh units
    EXPECT_NEAR(glm::length(pair->eye + tree.origin() - glm::dvec3(0, 0, 1.5)), 0, 1e-12);
    right.orthographic_height = 1;
    right.shift = {0, 0};
    EXPECT_FALSE(viewpoint_of_pair(tree, left, right));
    left = right;
    EXPECT_TRUE(viewpoint_of_pair(tree, left, right));
    left.orthographic_height = 2;
    EXPECT_FALSE(viewpoint_of_pair(tree, left, right));
    left.eye.x = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(viewpoint_of_pair(tree, left, left));
}

} // namespace unseen::vdtree::criteria_test
