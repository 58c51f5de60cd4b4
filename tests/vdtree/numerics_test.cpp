// Hard cases of numbers in geometry and masks: the entries of docs/numerics.md, each by its name. In each the naive twin, a
// formula as textbooks have it, is shown to fail where what the library does holds its bound.

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/depth_picture.h>
#include <unseen/vdtree/internal/footprint.h>
#include <unseen/vdtree/internal/normal_mask.h>

#include "build/bounding_sphere.h"
#include "build/quadric.h"
#include "built.h"
#include "exact.h"
#include "exact_sphere.h"
#include "shapes.h"
#include "testing.h"
#include "tree_checks.h"
#include <unseen/vdtree/internal/vectors.h>

namespace unseen::vdtree {
namespace {

using shapes::random_between;
using shapes::random_direction;
using support::built;
using support::Wide;
using Points = std::vector<glm::dvec3>;

constexpr double pi = std::numbers::pi;

std::vector<float> costs_from(const VertexTree& tree, const DistanceCriterion& criterion, const Viewpoint& viewpoint) {
    const auto costs = require(find_every_cost(tree, criterion, viewpoint));
    return *costs;
}

DistanceCriterion extent(const VertexTree& tree, const View& view, double pixels = 1) {
    return std::move(*require(extent_criterion(tree, view, pixels)));
}

double naive_angle(double radius, double distance) { return 2 * std::asin(radius / distance); }

TEST(Numerics, EyeInsideOnAndAtTheCentreOfASphere) {
    const VertexTree tree = built(shapes::icosphere(3));
    const View view;
    const DistanceCriterion criterion = extent(tree, view);
    const Sphere root = tree.support_spheres()[VertexTree::root()];
    const double radius = static_cast<double>(root.radius), pixel = 1 / pixels_per_radian(view);
    for (const double share : {0.0, 1e-30, 0.5, 1 - 1e-12, 1.0}) {
        const double distance = share * radius;
        const bool naive_folds = !(naive_angle(radius, distance) > pixel); // no number is above nothing
        if (share < 1) EXPECT_TRUE(naive_folds) << share;
        const Viewpoint there{.eye = glm::dvec3(root.centre) + glm::dvec3(distance, 0, 0)};
        const float cost = costs_from(tree, criterion, there)[VertexTree::root()];
        // On the sphere the distance is rounded: there the gap may be some units in the last place.
        EXPECT_GT(cost, share < 1 ? std::numeric_limits<float>::max() : 1e6f) << share;
        Cut cut(tree);
        ASSERT_TRUE(cut.follow(criterion, there));
        EXPECT_TRUE(cut.is_unfolded(VertexTree::root())) << share;
    }
}

// Pixels by the depth of the centre.
double naive_pixels(const View& view, glm::dvec3 centre, double radius) {
    return 2 * radius * pixels_per_radian(view) / -glm::dot(centre - view.eye, camera_frame(view).back);
}

TEST(Numerics, NodesBehindTheEye) {
    const VertexTree tree = built(shapes::icosphere(3));
    const Sphere root = tree.support_spheres()[VertexTree::root()];
    // The sphere's middle is behind the eye, and its front is in the window.
    View view{.eye = {0.3, 0, 1.2}, .target = {1.3, 0, 1.2}, .up = {0, 0, 1}, .fov_y_degrees = 120};
    EXPECT_LT(naive_pixels(view, glm::dvec3(root.centre), static_cast<double>(root.radius)), 0) << "and so it folds";
    const DistanceCriterion criterion = extent(tree, view);
    const auto seen_from = [&](const View& v) {
        return costs_from(tree, criterion,
                          {.eye = eye_in_tree(tree, v, {}), .frusta = {frustum_of(tree, v)}})[VertexTree::root()];
    };
    EXPECT_GT(seen_from(view), 1);
    // And where all of it is behind, its distance does not count.
    view.eye = {4, 0, 0}, view.target = {5, 0, 0};
    EXPECT_EQ(seen_from(view), 0);
    // A corner of a node is in the window: the node is not out, wherever its middle is.
    std::mt19937_64 random(1);
    constexpr double fields[] = {1, 90, 120, 179.9};
    for (int round = 0; round < 80; ++round) {
        view.fov_y_degrees = fields[round % 4];
        view.eye = random_direction(random) * random_between(random, 0.5, 1.5);
        view.target = view.eye + random_direction(random);
        const auto costs =
            costs_from(tree, criterion, {.eye = eye_in_tree(tree, view, {}), .frusta = {frustum_of(tree, view)}});
        const Projector project(view);
        for (NodeId node = 0; node < tree.interior_count(); ++node) {
            const Footprint at = project(tree.origin() + glm::dvec3(tree.position(node)));
            if (at.nearest > 0 && at.left > 0 && at.left < view.width && at.top > 0 && at.top < view.height)
                ASSERT_GT(costs[node], 0) << node;
        }
    }
}

// What a depth buffer of floats keeps, from the near plane on: 1 - near / depth.
float naive_depth(float depth) { return 1 - 0.1f / depth; }

TEST(Numerics, NodesBeyondTheFarPlane) {
    const VertexTree tree = built(shapes::icosphere(2));
    const View view{.eye = {0, 0, 1}, .fov_y_degrees = 1e-6}; // a telescope, to which all of it matters
    const DistanceCriterion criterion = extent(tree, view);
    const double radius = static_cast<double>(tree.support_spheres()[VertexTree::root()].radius);
    constexpr double bound = 1e-6; // of the gap: a few roundings of floats
    for (const double far : {1e5, 1e7, 1e12, 1e17}) {
        const double farther = far * 1.001;
        EXPECT_EQ(naive_depth(static_cast<float>(far)), naive_depth(static_cast<float>(farther))) << far;
        const auto cost = [&](double distance) {
            return static_cast<double>(costs_from(tree, criterion, {.eye = {0, 0, distance}})[VertexTree::root()]);
        };
        EXPECT_NEAR(cost(far) / cost(farther) / ((farther - radius) / (far - radius)), 1, bound) << far;
        const View from_there{.eye = {0, 0, far}};
        EXPECT_GT(costs_from(tree, criterion, viewpoint_of(tree, from_there))[VertexTree::root()], 0) << far;
    }
}

// A point in the window by its tangent, as a division makes it.
bool naive_in_window(double along, double right, double tangent) { return std::abs(right / along) <= tangent; }
// In lengths, from how far away so many pixels are filled.
double naive_switch_distance(const View& view, double pixels) {
    return 1 / std::sin(pixels / pixels_per_radian(view) / 2) - 1;
}

TEST(Numerics, FieldsOf90And180Degrees) {
    std::mt19937_64 random(2);
    int naive_wrong = 0;
    for (const double field : {90.0, 179.0, 179.9}) {
        const View view{.eye = {0, 0, 0}, .target = {0, 0, -1}, .fov_y_degrees = field};
        const Projector project(view);
        const double tangent = std::tan(field * pi / 360);
        for (int round = 0; round < 1000; ++round) {
            // Around the sides of the window, and around a right angle to the line of sight.
            const double angle = random() % 2 ? pi / 2 + random_between(random, -1e-3, 1e-3)
                                              : (field / 2 + random_between(random, -1, 1)) * pi / 180;
            const glm::dvec3 p(std::sin(angle), 0, -std::cos(angle));
            const bool truth = std::abs(angle) < pi / 2 && std::abs(p.x) <= -p.z * tangent;
            const Footprint at = project(p);
            const bool is_in = at.nearest > 0 && at.left >= 0 && at.left <= view.width;
            const double edge = std::abs(std::abs(angle) - field * pi / 360);
            if (edge > 1e-12) ASSERT_EQ(is_in, truth) << field << " " << angle;
            naive_wrong += naive_in_window(-p.z, p.x, tangent) != truth;
        }
    }
    EXPECT_GT(naive_wrong, 100);
    for (const double none : {180.0, 181.0, 360.0, 0.0, -90.0}) EXPECT_FALSE(validate(View{.fov_y_degrees = none}));
    // A pixel fills more than a right angle: the sine of half of it comes back to where thin ones are.
    const VertexTree tree = built(shapes::tetrahedron());
    const View wide{.fov_y_degrees = 179.9, .width = 10, .height = 10};
    bool naive_is_negative = false;
    for (const double pixels : {1.0, 2.0, 3.0, 10.0, 1e6}) {
        naive_is_negative |= naive_switch_distance(wide, pixels) < -1;
        EXPECT_EQ(extent(tree, wide, pixels).parts().switch_distance[0], 0) << pixels;
    }
    EXPECT_TRUE(naive_is_negative);
}

TEST(Numerics, NodesOfRadiusZero) {
    // Three places that floats do not tell apart.
    Mesh mesh = shapes::cube(1);
    const Index first = static_cast<Index>(mesh.positions.size());
    for (int k = 0; k < 3; ++k) mesh.positions.push_back(glm::dvec3(1, 2, 3) + 1e-10 * glm::dvec3(k, k * k, 0));
    mesh.triangles.push_back({first, first + 1, first + 2});
    const VertexTree tree = built(mesh);
    NodeId node = support::sound(tree).parents()[tree.place_of_leaf(0)];
    for (NodeId n = 0; n < tree.interior_count(); ++n)
        if (tree.support_spheres()[n].radius == 0) node = n;
    ASSERT_EQ(tree.support_spheres()[node].radius, 0);
    const View view;
    EXPECT_TRUE(std::isnan(naive_angle(0, 0)));
    const glm::dvec3 there = glm::dvec3(1, 2, 3) - tree.origin();
    for (const glm::dvec3& eye : {there, there + glm::dvec3(1e-300, 0, 0), there + glm::dvec3(1e-20), glm::dvec3(9)}) {
        const float cost = costs_from(tree, extent(tree, view), {.eye = eye})[node];
        EXPECT_TRUE(eye == glm::dvec3(9) ? cost < 1e-3f : cost >= 0) << cost;
        const auto displacement = require(displacement_criterion(tree, view, 1));
        EXPECT_EQ(costs_from(tree, *displacement, {.eye = eye})[node], 0) << "nothing moves";
    }
}

// The sphere through four points, by Cramer's rule.
double naive_radius(const Points& p) {
    const glm::dvec3 a = p[1] - p[0], b = p[2] - p[0], c = p[3] - p[0];
    const double volume = 2 * glm::dot(a, glm::cross(b, c));
    return glm::length(
        (glm::dot(a, a) * glm::cross(b, c) + glm::dot(b, b) * glm::cross(c, a) + glm::dot(c, c) * glm::cross(a, b)) /
        volume);
}

TEST(Numerics, CoincidentCollinearAndCocircularPoints) {
    struct Case {
        const char* name;
        Points points;
        double radius;
    };
    const auto on_circle = [](double angle) { return glm::dvec3(std::cos(angle), std::sin(angle), 0.5); };
    const std::vector<Case> cases = {
        {"coincident", Points(4, glm::dvec3(1, 2, 3)), 0},
        {"two places", {{0, 0, 0}, {2, 0, 0}, {0, 0, 0}, {2, 0, 0}}, 1},
        {"collinear", {{0, 0, 0}, {1, 1, 1}, {3, 3, 3}, {2, 2, 2}}, 1.5 * std::sqrt(3.0)},
        {"cocircular", {on_circle(0), on_circle(2), on_circle(4), on_circle(5)}, 1},
        {"square", {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, std::sqrt(0.5)},
    };
    constexpr double bound = 1e-9; // of the radius
    for (const double scale : {1.0, 1e-30, 1e30}) {
        for (const auto& [name, given, radius] : cases) {
            Points points = given;
            for (glm::dvec3& p : points) p *= scale;
            const double naive = naive_radius(points);
            EXPECT_FALSE(std::abs(naive - radius * scale) <= bound * radius * scale) << name;
            const DSphere sphere = smallest_sphere(points);
            EXPECT_NEAR(sphere.radius, radius * scale, bound * radius * scale) << name;
            for (const glm::dvec3& p : points)
                EXPECT_LE(glm::distance(p, sphere.centre), sphere.radius * (1 + 1e-14)) << name;
#ifdef UNSEEN_TEST_WITH_CGAL
            EXPECT_NEAR(sphere.radius, support::exact_radius(points), bound * radius * scale) << name;
#endif
        }
    }
}

float naive_length(glm::vec3 v) { return std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z); }

TEST(Numerics, CoordinatesTinyHugeFarAndMixed) {
    // Directions: squares leave the range long before the numbers do.
    for (const double scale : {1e-300, 1e-30, 1e-6, 1e7, 1e30, 1e300}) {
        const glm::dvec3 v = scale * glm::dvec3(1, -2, 2);
        if (scale == 1e-30) EXPECT_EQ(naive_length(glm::vec3(v)), 0);
        if (scale == 1e30) EXPECT_TRUE(std::isinf(naive_length(glm::vec3(v))));
        EXPECT_LT(glm::distance(unit(v), glm::dvec3(1, -2, 2) / 3.0), 4e-16) << scale;
    }
    EXPECT_EQ(unit({0, 0, 0}), glm::dvec3(0));

    // Northings: floats of the coordinates themselves tell no less than half a metre apart.
    const Mesh map = shapes::placed(shapes::bumpy_sphere(3), 30, {5.0e5, 1.0e7, 120});
    const VertexTree tree = built(map);
    double naive_error = 0, error = 0;
    for (Index leaf = 0; leaf < tree.leaf_count(); ++leaf) {
        const glm::dvec3 p = map.positions[tree.source_vertices()[leaf]];
        naive_error = std::max(naive_error, glm::distance(glm::dvec3(glm::vec3(p)), p));
        error =
            std::max(error, glm::distance(tree.origin() + glm::dvec3(tree.positions()[tree.wedge_of_leaf(leaf)]), p));
    }
    EXPECT_GT(naive_error, 0.3);
    EXPECT_LT(error, 5e-6); // half a unit in the last place of a float of 60 m

    // An axis of each size in one mesh: spheres hold what they are around, and nothing is no number.
    for (const glm::dvec3& size :
         {glm::dvec3(1e30, 1e7, 1e-6), glm::dvec3(1e-30, 1, 1e7), glm::dvec3(1e-6, 1e-30, 1e-6)}) {
        Mesh mixed = shapes::bumpy_sphere(2);
        for (glm::dvec3& p : mixed.positions) p *= size;
        const VertexTree of_mixed = built(mixed);
        const auto sound = verify(of_mixed);
        EXPECT_TRUE(sound) << size.x << ": " << sound.error().message;
        EXPECT_EQ(support::fault_when_unfolded(of_mixed, mixed.view()), "") << size.x;
    }
}

glm::vec3 naive_normal(glm::vec3 a, glm::vec3 b, glm::vec3 c) { return glm::normalize(glm::cross(b - a, c - a)); }

TEST(Numerics, SliversAndTrianglesWithoutArea) {
    // A millimetre high, a metre long, ten thousand kilometres from the origin.
    std::mt19937_64 random(3);
    constexpr double bound = 1e-4; // of packed normals 6.5e-5, and of doubles at 1e7 what is left
    int naive_lost = 0;
    constexpr int rounds = 50;
    for (int round = 0; round < rounds; ++round) {
        const glm::dvec3 at(5e5, 1e7, 100), along = random_direction(random),
                                            up = glm::normalize(glm::cross(along, random_direction(random)));
        Mesh mesh;
        mesh.positions = {at, at + along, at + 0.5 * along + 1e-3 * up};
        mesh.triangles = {{0, 1, 2}};
        using Wide3 = glm::vec<3, long double>;
        const Wide3 a(mesh.positions[0]);
        const glm::dvec3 truth(glm::normalize(glm::cross(Wide3(mesh.positions[1]) - a, Wide3(mesh.positions[2]) - a)));
        const glm::vec3 naive =
            naive_normal(glm::vec3(mesh.positions[0]), glm::vec3(mesh.positions[1]), glm::vec3(mesh.positions[2]));
        naive_lost += !(glm::distance(glm::dvec3(naive), truth) < 0.1);
        const VertexTree tree = built(mesh);
        for (const PackedNormal packed : tree.normals()) {
            const glm::dvec3 normal = glm::dvec3(glm::vec3(packed));
            // Of an open surface either side may be the outer one.
            EXPECT_LT(std::min(glm::distance(normal, truth), glm::distance(-normal, truth)), bound) << round;
        }
        const NormalMask mask = tree.mask(VertexTree::root());
        EXPECT_TRUE(mask.contains(normal_cell(truth)) || mask.contains(normal_cell(-truth))) << round;
    }
    EXPECT_GT(naive_lost, rounds * 9 / 10);
    // Without an area there is no direction, and no facing to be wrong about.
    EXPECT_TRUE(std::isnan(naive_normal({0, 0, 0}, {1, 0, 0}, {2, 0, 0}).x));
    Mesh flat;
    flat.positions = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}};
    flat.triangles = {{0, 1, 2}, {1, 2, 3}};
    const VertexTree tree = built(flat);
    EXPECT_TRUE(verify(tree));
    for (const PackedNormal packed : tree.normals()) EXPECT_EQ(packed, PackedNormal{});
    EXPECT_TRUE(tree.mask(VertexTree::root()).empty());
}

struct Plane3 {
    glm::dvec3 normal, point;
};
using Floats = std::array<float, most_quadric_floats>;

// Of a plane, seen from a place.
void add_plane(const Plane3& plane, glm::dvec3 place, Floats& q) {
    const glm::dvec3 n = plane.normal;
    const double away = glm::dot(n, plane.point - place);
    const double values[] = {n.x * n.x,   n.x * n.y,   n.x * n.z,   n.y * n.y,   n.y * n.z, n.z * n.z,
                             -away * n.x, -away * n.y, -away * n.z, away * away, 1};
    for (std::size_t i = 0; i < std::size(values); ++i) q[i] += static_cast<float>(values[i]);
}
// What a place is away from planes, squared and summed.
Wide exact_error(std::span<const Plane3> planes, glm::dvec3 at) {
    Wide sum = 0;
    for (const Plane3& plane : planes) {
        Wide away = 0;
        for (int k = 0; k < 3; ++k)
            away += static_cast<Wide>(plane.normal[k]) * (static_cast<Wide>(at[k]) - static_cast<Wide>(plane.point[k]));
        sum += away * away;
    }
    return sum;
}

// The minimum of a quadric by Cramer's rule.
glm::vec3 naive_minimum(const Floats& q) {
    using namespace quadric;
    const glm::mat3 m(q[xx], q[xy], q[xz], q[xy], q[yy], q[yz], q[xz], q[yz], q[zz]);
    return -(glm::inverse(m) * glm::vec3(q[hx], q[hy], q[hz]));
}

TEST(Numerics, QuadricsOfRank1And2) {
    std::mt19937_64 random(4);
    int naive_away = 0;
    constexpr int rounds = 400, steps = 2;
    for (int round = 0; round < rounds; ++round) {
        // One plane, or two that meet in a line; also nearly the same one, which is of rank 2 for doubles alone.
        std::vector<Plane3> planes = {{random_direction(random), 0.1 * random_direction(random)}};
        if (round % 3 == 1) planes.push_back({random_direction(random), 0.1 * random_direction(random)});
        if (round % 3 == 2)
            planes.push_back({glm::normalize(planes[0].normal + 1e-6 * random_direction(random)), planes[0].point});
        Floats q{};
        for (const Plane3& plane : planes) add_plane(plane, glm::dvec3(0), q);
        const glm::vec3 naive = naive_minimum(q);
        naive_away += !(glm::length(naive) < 2);
        const glm::dvec3 other = random_direction(random); // the other place of the pair
        const auto best = minimise<float>(
            Form<float>::of_base(q.data()),
            {static_cast<float>(other.x), static_cast<float>(other.y), static_cast<float>(other.z)}, steps);
        // Not farther from the pair's middle than its places are from each other, and as good as it says.
        const glm::dvec3 at(best.at.x, best.at.y, best.at.z);
        ASSERT_LE(glm::distance(at, 0.5 * other), 1.0001) << round;
        constexpr double bound = 2e-6; // of the squares of distances up to 1.5, in floats
        ASSERT_NEAR(static_cast<double>(best.error), static_cast<double>(exact_error(planes, at)), bound) << round;
    }
    EXPECT_GT(naive_away, rounds / 8) << "or no number at all";
}

// The error at a place of a quadric about the origin: n n' x x - 2 d n x + d d.
float naive_error(const Floats& q, glm::vec3 x) {
    using namespace quadric;
    return q[xx] * x.x * x.x + q[yy] * x.y * x.y + q[zz] * x.z * x.z +
           2 * (q[xy] * x.x * x.y + q[xz] * x.x * x.z + q[yz] * x.y * x.z) +
           2 * (q[hx] * x.x + q[hy] * x.y + q[hz] * x.z) + q[k];
}

TEST(Numerics, CancellationInQuadrics) {
    std::mt19937_64 random(5);
    const glm::dvec3 far(5e5, 1e7, 100);
    double naive_worst = 0;
    for (int round = 0; round < 100; ++round) {
        // Planes through points of a cluster of a metre, each seen from its own point, brought together pair by pair.
        std::vector<Plane3> planes;
        Floats sum{}, about_origin{};
        glm::dvec3 place = far;
        for (int i = 0; i < 64; ++i) {
            planes.push_back({random_direction(random), far + 0.5 * random_direction(random)});
            add_plane(planes.back(), glm::dvec3(0), about_origin);
            Floats own{}, both{};
            add_plane(planes.back(), planes.back().point, own);
            const glm::vec3 d(planes.back().point - place);
            add_base<float>(sum.data(), own.data(), {d.x, d.y, d.z}, both.data());
            sum = both;
        }
        const glm::dvec3 at = far + 0.5 * random_direction(random);
        const double truth = static_cast<double>(exact_error(planes, at));
        naive_worst =
            std::max(naive_worst, std::abs(static_cast<double>(naive_error(about_origin, glm::vec3(at))) - truth));
        const double error = static_cast<double>(naive_error(sum, glm::vec3(at - place)));
        EXPECT_NEAR(error, truth, 1e-5 * truth) << round;
    }
    EXPECT_GT(naive_worst, 1e6) << "square metres, of some ten";
}

// The face and cell of a direction, from coordinates of 0 to 1 times the number of cells.
int naive_cell(glm::dvec3 n) {
    const glm::dvec3 size = glm::abs(n);
    const int axis = size.x > size.y && size.x > size.z   ? 0
                     : size.y > size.x && size.y > size.z ? 1
                     : size.z > size.x && size.z > size.y ? 2
                                                          : -1;
    if (axis < 0) return -1; // on an edge: of no face
    const auto index = [&](double along) {
        return static_cast<int>((std::atan(along / size[axis]) / (pi / 2) + 0.5) * 8);
    };
    return (axis * 2 + (n[axis] < 0)) * 64 + index(n[(axis + 2) % 3]) * 8 + index(n[(axis + 1) % 3]);
}

// Whether a direction is in a cell but for `margin`, by the planes through the cell's sides.
bool is_in_cell(glm::dvec3 n, int cell, double margin) {
    const NormalCell& c = normal_cells()[static_cast<std::size_t>(cell)];
    const auto corner = [&](std::size_t k) { return glm::dvec3(c.x[k], c.y[k], c.z[k]); };
    constexpr std::size_t around[] = {0, 1, 3, 2};
    const glm::dvec3 middle = corner(0) + corner(1) + corner(2) + corner(3);
    for (std::size_t i = 0; i < 4; ++i) {
        const glm::dvec3 side = glm::normalize(glm::cross(corner(around[i]), corner(around[(i + 1) % 4])));
        if (glm::dot(side, n) * (glm::dot(side, middle) > 0 ? 1 : -1) < -margin) return false;
    }
    return true;
}

TEST(Numerics, NormalsOnCubeEdgesAndCorners) {
    constexpr double margin = 1e-5; // what facing() allows for
    int naive_wrong = 0, on_edges = 0;
    for (int x = -8; x <= 8; ++x)
        for (int y = -8; y <= 8; ++y)
            for (int z = -8; z <= 8; ++z) {
                // All borders of cells, of which those of the cube's faces are a part.
                const auto border = [](int i) { return std::tan(i * pi / 32); };
                if (std::max({std::abs(x), std::abs(y), std::abs(z)}) != 8) continue;
                const glm::dvec3 n(border(x), border(y), border(z));
                const int cell = normal_cell(n);
                ASSERT_GE(cell, 0);
                ASSERT_LT(cell, normal_cell_count);
                ASSERT_TRUE(is_in_cell(glm::normalize(n), cell, margin)) << n.x << " " << n.y << " " << n.z;
                const int naive = naive_cell(n);
                ++on_edges;
                naive_wrong += naive < 0 || naive >= normal_cell_count || !is_in_cell(glm::normalize(n), naive, margin);
                for (const double scale : {1e-300, 1e-6, 1e7, 1e300}) ASSERT_EQ(normal_cell(scale * n), cell);
            }
    EXPECT_GT(naive_wrong, on_edges / 16);
    EXPECT_EQ(normal_cell({1, 1, 1}), normal_cell({1e-320, 1e-320, 1e-320}));
}

glm::dvec3 naive_direction(glm::dvec3 v) { return v / glm::length(v); }

TEST(Numerics, NormalsWithoutDirection) {
    const double inf = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
    for (const glm::dvec3& n :
         {glm::dvec3(0), glm::dvec3(nan, 0, 1), glm::dvec3(inf, 0, 0), glm::dvec3(-inf, inf, 1)}) {
        const glm::dvec3 naive = naive_direction(n);
        EXPECT_FALSE(naive.x * naive.x + naive.y * naive.y + naive.z * naive.z <= 1.0000001) << "no cell's number";
        EXPECT_EQ(normal_cell(n), -1);
        EXPECT_EQ(unit(n), glm::dvec3(0));
        EXPECT_EQ(PackedNormal::nearest(glm::vec3(n)), PackedNormal{});
    }
}

// By the direction to the sphere's middle alone.
bool naive_faces(glm::dvec3 normal, glm::dvec3 to_eye) { return glm::dot(normal, to_eye) > 0; }

TEST(Numerics, SilhouettesAtGrazingAngles) {
    std::mt19937_64 random(6);
    int naive_wrong = 0;
    for (int round = 0; round < 20'000; ++round) {
        const double radius = std::pow(10.0, random_between(random, -6, 0));
        const double distance = radius * (1 + std::pow(10.0, random_between(random, -3, 4)));
        const glm::dvec3 to_eye = random_direction(random),
                         aside = glm::normalize(glm::cross(to_eye, random_direction(random)));
        // Around the angle at which the farthest point of the sphere sees the normal from the side.
        const double sine = radius / distance * random_between(random, -1.1, 1.1) + random_between(random, -1e-6, 1e-6);
        const glm::dvec3 n = glm::normalize(aside + sine * to_eye);
        NormalMask mask;
        mask.insert(normal_cell(n));
        NormalSlabs slabs;
        slabs.insert(n);
        const Facing found =
            facing(slabs, mask, glm::vec3(to_eye), static_cast<float>(distance), static_cast<float>(radius));
        // A point of the sphere, and what of the surface there the eye sees.
        const glm::dvec3 eye = to_eye * distance;
        for (const double where : {-1.0, 1.0}) {
            const glm::dvec3 point = where * radius * n;
            const bool faces = glm::dot(n, eye - point) > 0;
            naive_wrong += naive_faces(n, to_eye) != faces;
            if (faces) {
                ASSERT_NE(found, Facing::back) << round;
            } else {
                ASSERT_NE(found, Facing::front) << round;
            }
        }
    }
    EXPECT_GT(naive_wrong, 1000);
}

TEST(Numerics, DirectionsRoundedToBytes) {
    std::mt19937_64 random(7);
    int naive_outside = 0;
    for (int round = 0; round < 10'000; ++round) {
        const glm::dvec3 n = random_direction(random);
        NormalSlabs slabs;
        slabs.insert(n);
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const double along = n[static_cast<int>(axis)] * 127;
            const auto naive = static_cast<std::int8_t>(along); // towards 0
            naive_outside += std::abs(along) > std::abs(naive);
            ASSERT_LE(slabs.lo[axis], along);
            ASSERT_GE(slabs.hi[axis], along);
            ASSERT_LE(slabs.hi[axis] - slabs.lo[axis], 2) << "and not wide";
        }
    }
    EXPECT_GT(naive_outside, 20'000);
    // 128 is no byte: the ends do not wrap.
    NormalSlabs ends;
    ends.insert({1, 0, 0});
    EXPECT_EQ(ends.hi[0], 127);
}

float naive_eccentricity(glm::vec3 towards, glm::vec3 gaze) { return std::acos(glm::dot(towards, gaze)); }

TEST(Numerics, EccentricitiesOf0And90And180Degrees) {
    const VertexTree tree = built(shapes::icosphere(1));
    DistanceCriterion::Parts parts;
    parts.spheres = DistanceCriterion::Spheres::support;
    parts.lengths.assign(tree.interior_count(), 1);
    parts.eccentricity_bins = 181;
    for (int bin = 0; bin <= 180; ++bin) parts.switch_distance.push_back(static_cast<float>(1000 - bin));
    const auto criterion = require(DistanceCriterion::create(tree, parts));
    const Sphere root = tree.support_spheres()[VertexTree::root()];
    std::mt19937_64 random(8);
    int naive_nans = 0;
    constexpr double bound_deg = 1e-4; // two angles in floats, and the gaze
    for (const double angle_deg : {0.0, 1e-4, 0.5, 89.5, 90.0, 90.5, 179.5, 180.0}) {
        for (int round = 0; round < 200; ++round) {
            const glm::dvec3 towards = random_direction(random),
                             aside = glm::normalize(glm::cross(towards, random_direction(random)));
            const double angle = angle_deg * pi / 180, distance = 1e4;
            const glm::dvec3 gaze = std::cos(angle) * towards + std::sin(angle) * aside;
            naive_nans += std::isnan(naive_eccentricity(glm::vec3(towards), glm::vec3(gaze)));
            const Viewpoint there{.eye = glm::dvec3(root.centre) - distance * towards, .gaze = gaze};
            const double cost = static_cast<double>(costs_from(tree, *criterion, there)[VertexTree::root()]);
            const double bin = 1000 - cost * (distance - static_cast<double>(root.radius));
            const double truth_deg =
                std::max(angle_deg - std::asin(static_cast<double>(root.radius) / distance) * 180 / pi, 0.0);
            ASSERT_GE(bin, std::floor(std::max(truth_deg - bound_deg, 0.0)) - 0.01) << angle_deg;
            ASSERT_LE(bin, std::floor(truth_deg + bound_deg) + 0.01) << angle_deg;
        }
    }
    EXPECT_GT(naive_nans, 20);
}

} // namespace
} // namespace unseen::vdtree
