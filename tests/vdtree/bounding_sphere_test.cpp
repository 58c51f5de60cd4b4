// Enclosing spheres against CGAL's exact smallest ones, against exact containment, and how tight those of a tree are.
#include "build/bounding_sphere.h"

#include <iostream>

#include <unseen/vdtree/builder.h>

#include "exact.h"
#include "exact_sphere.h"
#include "shapes.h"
#include "sound.h"
#include "testing.h"

namespace unseen::vdtree {
namespace {

using shapes::random_between;
using shapes::random_direction;
using shapes::random_unit;
using Points = std::vector<glm::dvec3>;
#ifdef UNSEEN_TEST_WITH_CGAL
using support::exact_radius;
#endif

// Of the radius: distances in double round a few times.
constexpr double rounding = 1e-14;
// Of the radius: a smallest sphere is defined by up to four points through a linear system, which near-degenerate
// sets make ill-conditioned; the radius, being a minimum, suffers only to second order.
constexpr double radius_tolerance = 1e-9;

struct NamedPoints {
    const char* name;
    std::function<Points(std::mt19937_64&)> make;
};

Points repeat(std::mt19937_64& random, int most, const std::function<glm::dvec3(int)>& make) {
    const int count = 1 + static_cast<int>(random() % static_cast<unsigned>(most));
    Points points;
    for (int i = 0; i < count; ++i) points.push_back(make(i));
    return points;
}

std::vector<NamedPoints> point_sets() {
    const auto between = random_between;
    return {
        {"in a cube",
         [=](auto& r) {
             return repeat(r, 60,
                           [&](int) { return glm::dvec3(between(r, -1, 1), between(r, -1, 1), between(r, -1, 1)); });
         }},
        {"on a sphere", [=](auto& r) { return repeat(r, 60, [&](int) { return random_direction(r); }); }},
        {"on a line",
         [=](auto& r) {
             const glm::dvec3 d = random_direction(r);
             return repeat(r, 30, [&](int) { return d * between(r, -1, 1); });
         }},
        {"on a line along an axis",
         [=](auto& r) { return repeat(r, 30, [&](int i) { return glm::dvec3(i * i, 0, 0); }); }},
        {"in a plane",
         [=](auto& r) {
             const glm::dvec3 d = random_direction(r), e = glm::normalize(glm::cross(d, random_direction(r)));
             return repeat(r, 40, [&](int) { return d * between(r, -1, 1) + e * between(r, -1, 1); });
         }},
        {"on a circle",
         [=](auto& r) {
             return repeat(r, 40, [&](int) {
                 const double a = between(r, 0, 6.3);
                 return glm::dvec3(std::cos(a), std::sin(a), 0.5);
             });
         }},
        {"at one place",
         [](auto& r) {
             const glm::dvec3 p = random_direction(r);
             return repeat(r, 20, [&](int) { return p; });
         }},
        {"at two places",
         [](auto& r) {
             const glm::dvec3 p = random_direction(r), q = random_direction(r);
             return repeat(r, 20, [&](int i) { return i % 2 ? p : q; });
         }},
        {"on a lattice",
         [](auto& r) {
             return repeat(r, 64, [&](int) {
                 return glm::dvec3(static_cast<double>(r() % 4), static_cast<double>(r() % 4),
                                   static_cast<double>(r() % 4));
             });
         }},
        {"nearly in a plane",
         [=](auto& r) {
             return repeat(
                 r, 30, [&](int) { return glm::dvec3(between(r, -1, 1), between(r, -1, 1), between(r, -1e-9, 1e-9)); });
         }},
        {"far from the origin",
         [](auto& r) { return repeat(r, 40, [&](int) { return glm::dvec3(5e5, 5e6, 100) + random_direction(r); }); }},
        {"two tight clusters",
         [](auto& r) {
             return repeat(r, 30, [&](int i) { return glm::dvec3(i % 2, 0, 0) + 1e-7 * random_direction(r); });
         }},
    };
}

void expect_contains(const DSphere& sphere, const Points& points) {
    for (const glm::dvec3& p : points) ASSERT_LE(glm::distance(p, sphere.centre), sphere.radius * (1 + rounding));
}

TEST(SmallestSphere, ContainsItsPointsAndIsTheSmallest) {
    std::mt19937_64 random(1);
    for (const NamedPoints& set : point_sets()) {
        for (const double scale : {1.0, 1e-30, 1e30}) {
            SCOPED_TRACE(std::string(set.name) + " times " + std::to_string(scale));
            for (int round = 0; round < 12; ++round) {
                Points points = set.make(random);
                for (glm::dvec3& p : points) p *= scale;
                const DSphere sphere = smallest_sphere(points);
                expect_contains(sphere, points);
#ifdef UNSEEN_TEST_WITH_CGAL
                const double exact = exact_radius(points);
                ASSERT_LE(sphere.radius, exact * (1 + radius_tolerance)) << points.size() << " points";
                ASSERT_GE(sphere.radius, exact * (1 - rounding));
#endif
            }
        }
    }
#ifndef UNSEEN_TEST_WITH_CGAL
    GTEST_SKIP() << "CGAL was not found: containment was tested, minimality was not";
#endif
}

TEST(SmallestSphere, KnowsTheSpheresOfSimpleSets) {
    EXPECT_LT(smallest_sphere({}).radius, 0);
    const Points one = {{1, 2, 3}};
    EXPECT_EQ(smallest_sphere(one).centre, glm::dvec3(1, 2, 3));
    EXPECT_EQ(smallest_sphere(one).radius, 0);
    const Points two = {{-1, 0, 0}, {3, 0, 0}};
    EXPECT_EQ(smallest_sphere(two).centre, glm::dvec3(1, 0, 0));
    EXPECT_EQ(smallest_sphere(two).radius, 2);
    EXPECT_NEAR(smallest_sphere(shapes::cube(4).positions).radius, std::sqrt(3.0), 1e-12);
    const Points obtuse = {{-1, 0, 0}, {1, 0, 0}, {0, 0.1, 0}}; // the middle corner does not count
    EXPECT_NEAR(smallest_sphere(obtuse).radius, 1, 1e-12);
}

// What a lane holds, and what is promised of its sphere.
struct Lane {
    std::vector<glm::vec3> points;
    std::vector<Sphere> spheres;

    void expect_enclosed_by(const Sphere& sphere, double slack) const {
        Points wide_points(points.begin(), points.end());
        std::vector<DSphere> wide_spheres;
        for (const Sphere& s : spheres) wide_spheres.push_back({glm::dvec3(s.centre), s.radius});
        for (const glm::dvec3& p : wide_points) ASSERT_TRUE(support::contains(sphere, p, 0));
        for (const DSphere& s : wide_spheres) ASSERT_TRUE(support::contains(sphere, s.centre, s.radius));
#ifdef UNSEEN_TEST_WITH_CGAL
        constexpr double float_rounding = 2e-7; // of the centre's coordinates, and of the radius
        ASSERT_LE(sphere.radius, exact_radius(wide_points, wide_spheres) * (1 + slack + float_rounding) +
                                     float_rounding * glm::length(glm::dvec3(sphere.centre)))
            << points.size() << " points, " << spheres.size() << " spheres";
#else
        static_cast<void>(slack);
#endif
    }
};

TEST(BallLanes, EncloseEachLaneOnItsOwn) {
    constexpr double slack = 1e-3;
    std::mt19937_64 random(5);
    const std::vector<NamedPoints> sets = point_sets();
    BallLanes balls;
    for (const float scale : {1.0f, 1e-19f, 1e30f}) {
        for (int round = 0; round < 100; ++round) {
            std::vector<Lane> lanes(1 + random() % BallLanes::lanes);
            std::vector<Sphere> spheres(lanes.size());
            for (std::size_t i = 0; i < lanes.size(); ++i) {
                for (const glm::dvec3& p : sets[random() % sets.size()].make(random)) {
                    const glm::vec3 at = glm::vec3(p) * scale;
                    if (lanes[i].points.empty() || random() % 3 > 0) lanes[i].points.push_back(at);
                    else
                        lanes[i].spheres.push_back(
                            {at, scale * static_cast<float>(std::pow(10.0, random_between(random, -3, 0.5)))});
                }
                balls.begin(i, lanes[i].points[0]);
                for (std::size_t k = 1; k < lanes[i].points.size(); ++k) balls.add(i, lanes[i].points[k]);
                for (const Sphere& s : lanes[i].spheres) balls.add(i, s);
            }
            balls.enclose(slack, spheres);
            for (std::size_t i = 0; i < lanes.size(); ++i) lanes[i].expect_enclosed_by(spheres[i], slack);
            // And with more of one, and less of the other.
            for (std::size_t i = 0; i < lanes.size(); ++i) {
                std::vector<glm::vec3> more;
                std::vector<Index> which;
                for (const glm::dvec3& p : sets[random() % sets.size()].make(random)) {
                    more.push_back(glm::vec3(p) * scale);
                    if (random() % 2 == 0) which.push_back(static_cast<Index>(more.size() - 1));
                }
                balls.add(i, more, which);
                for (const Index k : which) lanes[i].points.push_back(more[k]);
                balls.forget_spheres(i);
                lanes[i].spheres.clear();
            }
            balls.enclose(slack, spheres);
            for (std::size_t i = 0; i < lanes.size(); ++i) lanes[i].expect_enclosed_by(spheres[i], slack);
        }
    }
}

TEST(RoundOutward, ContainsTheSphereExactly) {
    std::mt19937_64 random(4);
    for (int round = 0; round < 300'000; ++round) {
        const double scale = std::pow(10.0, random_between(random, -35, 35));
        DSphere sphere;
        sphere.centre = scale * random_between(random, 0, 2) * random_direction(random);
        sphere.radius = random() % 8 == 0 ? 0 : scale * std::pow(10.0, random_between(random, -9, 2));
        const Sphere rounded = round_outward(sphere);
        ASSERT_TRUE(support::contains(rounded, sphere.centre, sphere.radius)) << "round " << round;
        // Not wasteful either: the centre's rounding and two steps of the radius.
        const double most =
            (sphere.radius + glm::distance(glm::dvec3(rounded.centre), sphere.centre)) * (1 + 3e-7) + 3e-45;
        ASSERT_LE(rounded.radius, most);
    }
}

TEST(RoundOutward, KeepsPointsWithFloatCoordinates) {
    const Sphere point = round_outward({{1, -2, 0.5}, 0});
    EXPECT_EQ(point.radius, 0);
    EXPECT_EQ(point.centre, glm::vec3(1, -2, 0.5));
    EXPECT_EQ(round_outward({}).radius, 0);
}

struct Tightness {
    double support = 0, ring = 0; // mean of radius over smallest radius
    double worst = 0;
};

Tightness measure(const VertexTree& tree) {
    const NodeId interior = tree.interior_count();
    std::vector<std::vector<Index>> around(tree.leaf_count());
    for (Index t = 0; t < tree.triangle_count(); ++t)
        for (const Index leaf : support::sound(tree).triangles()[t]) around[leaf].push_back(t);
    Tightness result;
    int supports = 0, rings = 0;
    Points region;
    const auto ratio = [&](const Sphere& sphere, double& sum, int& count) {
        const double smallest = smallest_sphere(region).radius;
        if (!(smallest > 0)) return;
        sum += sphere.radius / smallest;
        result.worst = std::max(result.worst, sphere.radius / smallest);
        ++count;
    };
    const auto add = [&](NodeId node) { region.emplace_back(tree.position(node)); };
    for (NodeId node = 0; node < interior; ++node) {
        region.clear();
        for (NodeId below = node; below < support::sound(tree).subtree_end()[node]; ++below) add(below);
        for (Index leaf = support::sound(tree).first_leaf()[node]; leaf < support::sound(tree).leaf_end()[node]; ++leaf)
            add(tree.place_of_leaf(leaf));
        ratio(tree.support_spheres()[node], result.support, supports);
        for (Index leaf = support::sound(tree).first_leaf()[node]; leaf < support::sound(tree).leaf_end()[node]; ++leaf)
            for (const Index t : around[leaf])
                for (const Index corner : support::sound(tree).triangles()[t]) add(tree.place_of_leaf(corner));
        ratio(tree.bounds()[node].ring, result.ring, rings);
    }
    result.support /= supports;
    result.ring /= rings;
    return result;
}

TEST(TreeSpheres, AreTight) {
    constexpr double most_mean_excess = 1.15; // of the smallest radius; what the tree promises
    const std::vector<shapes::Named> meshes = {
        {"bumpy sphere", shapes::bumpy_sphere(4)},
        {"unwelded bumpy sphere", shapes::unwelded(shapes::bumpy_sphere(3))},
        {"unwelded soup", shapes::unwelded(shapes::random_soup(300, 800, 7))},
    };
    for (const shapes::Named& named : meshes) {
        for (const ClustererKind kind : {ClustererKind::quadric, ClustererKind::octree}) {
            const auto tree = require(build_tree(named.mesh.view(), {.clusterer = kind}));
            const Tightness tightness = measure(*tree);
            std::cout << named.name << ", " << name(kind) << ": mean radius over the smallest one " << tightness.support
                      << " (support), " << tightness.ring << " (ring); largest " << tightness.worst << '\n';
            EXPECT_LE(tightness.support, most_mean_excess);
            EXPECT_LE(tightness.ring, most_mean_excess);
            EXPECT_GE(tightness.support, 1);
            EXPECT_GE(tightness.ring, 1);
        }
    }
}

} // namespace
} // namespace unseen::vdtree
