// What holds of trees and cuts whatever the numbers are. ctest asks for a thousand cases of each, and for a hundred thousand in
// the label slow: RC_PARAMS=max_success=N.

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/internal/normal_mask.h>

#include "any_number.h"
#include "build/bounding_sphere.h"
#include "build/quadric.h"
#include "build/spatial_order.h"
#include "built.h"
#include "exact.h"
#include "follow_tools.h"
#include "shapes.h"
#include "testing.h"
#include "tree_checks.h"
#include <unseen/vdtree/internal/vectors.h>

namespace unseen::vdtree {
namespace {

using support::any_direction;
using support::any_number;
using support::any_point;
using support::between;
using support::Wide;

RC_GTEST_PROP(Properties, SmallestSpheresHoldTheirPointsAndAreNoLargerThanTheirBox, ()) {
    const auto count = *rc::gen::inRange(1, 12);
    const auto points =
        *rc::gen::container<std::vector<glm::dvec3>>(static_cast<std::size_t>(count), any_point(-30, 30));
    const DSphere sphere = smallest_sphere(points);
    constexpr double rounding = 1e-13; // of the radius
    glm::dvec3 low = points[0], high = points[0];
    for (const glm::dvec3& p : points) {
        RC_ASSERT(glm::distance(p, sphere.centre) <= sphere.radius * (1 + rounding));
        low = glm::min(low, p), high = glm::max(high, p);
    }
    RC_ASSERT(sphere.radius <= 0.5 * glm::distance(low, high) * (1 + 1e-9));
}

RC_GTEST_PROP(Properties, RoundedSpheresHoldTheExactOnes, ()) {
    const DSphere sphere{*any_point(-37, 37), std::abs(*any_number(-37, 37))};
    const Sphere rounded = round_outward(sphere);
    RC_ASSERT(support::contains(rounded, sphere.centre, sphere.radius));
}

RC_GTEST_PROP(Properties, DirectionsHaveLength1, ()) {
    const glm::dvec3 v = *any_point(-300, 300), u = unit(v);
    if (v == glm::dvec3(0)) RC_ASSERT(u == glm::dvec3(0));
    else RC_ASSERT(std::abs(glm::length(u) - 1) < 1e-15);
}

RC_GTEST_PROP(Properties, NormalsAreInTheirCellAndSlabs, ()) {
    const glm::dvec3 n = *any_direction();
    const int cell = normal_cell(n);
    RC_ASSERT(cell >= 0 && cell < normal_cell_count);
    RC_ASSERT(normal_cell(n * std::pow(10.0, *between(-290, 290))) == cell);
    // The cap around the cell's middle through its farthest corner.
    const NormalCell& c = normal_cells()[static_cast<std::size_t>(cell)];
    glm::dvec3 middle(0);
    for (std::size_t k = 0; k < 4; ++k) middle += glm::dvec3(c.x[k], c.y[k], c.z[k]);
    middle = glm::normalize(middle);
    double least = 1;
    for (std::size_t k = 0; k < 4; ++k) least = std::min(least, glm::dot(middle, glm::dvec3(c.x[k], c.y[k], c.z[k])));
    RC_ASSERT(glm::dot(middle, n) >= least - 1e-5);
    NormalSlabs slabs, other;
    slabs.insert(n);
    other.insert(*any_direction());
    other |= slabs;
    RC_ASSERT(other.includes(slabs));
    for (std::size_t axis = 0; axis < 3; ++axis) {
        RC_ASSERT(slabs.lo[axis] <= n[static_cast<int>(axis)] * 127);
        RC_ASSERT(slabs.hi[axis] >= n[static_cast<int>(axis)] * 127);
    }
}

RC_GTEST_PROP(Properties, WhatCanBeSeenIsNotRuledOut, ()) {
    const glm::dvec3 n = *any_direction(), to_eye = *any_direction();
    const double radius = std::pow(10.0, *between(-20, 10)), distance = radius * (1 + std::pow(10.0, *between(-3, 6)));
    NormalMask mask;
    mask.insert(normal_cell(n));
    NormalSlabs slabs;
    slabs.insert(n);
    const Facing found =
        facing(slabs, mask, glm::vec3(to_eye), static_cast<float>(distance), static_cast<float>(radius));
    const glm::dvec3 point = *between(0, 1) * radius * *any_direction();
    const bool faces = glm::dot(n, distance * to_eye - point) > 0;
    RC_ASSERT(found != (faces ? Facing::back : Facing::front));
}

RC_GTEST_PROP(Properties, QuadricsAreLeastBetweenTheirPairAndTellTheirError, ()) {
    std::array<float, most_quadric_floats> q{};
    struct Plane3 {
        glm::dvec3 n;
        double away;
    };
    std::vector<Plane3> planes;
    const auto count = *rc::gen::inRange(1, 8);
    double size = 0;
    for (int i = 0; i < count; ++i) {
        planes.push_back({*any_direction(), *between(-1, 1)});
        const auto& [n, away] = planes.back();
        const double values[] = {n.x * n.x,   n.x * n.y,   n.x * n.z,   n.y * n.y,   n.y * n.z, n.z * n.z,
                                 -away * n.x, -away * n.y, -away * n.z, away * away, 1};
        for (std::size_t k = 0; k < std::size(values); ++k) q[k] += static_cast<float>(values[k]);
        size += 8;
    }
    const glm::vec3 other(*any_direction());
    const auto best = minimise<float>(Form<float>::of_base(q.data()), {other.x, other.y, other.z}, 2);
    const glm::dvec3 at(best.at.x, best.at.y, best.at.z);
    RC_ASSERT(glm::distance(at, 0.5 * glm::dvec3(other)) <= 1.0001);
    double truth = 0;
    for (const auto& [n, away] : planes) truth += (glm::dot(n, at) - away) * (glm::dot(n, at) - away);
    RC_ASSERT(std::abs(static_cast<double>(best.error) - truth) <= 1e-6 * size);
}

RC_GTEST_PROP(Properties, CodesOfPointsAreOrderedAlongEachAxis, ()) {
    const double extent = std::pow(10.0, *between(-300, 300));
    const glm::dvec3 low = extent * glm::dvec3(*between(-2, 2), *between(-2, 2), *between(-2, 2));
    const MortonGrid grid(low, extent);
    const glm::dvec3 p(*between(-0.1, 1.1), *between(-0.1, 1.1), *between(-0.1, 1.1));
    glm::dvec3 q = p;
    const int axis = *rc::gen::inRange(0, 3);
    q[axis] += *between(0, 1);
    RC_ASSERT(grid.code(low + extent * p) <= grid.code(low + extent * q));
}

RC_GTEST_PROP(Properties, NumbersInSixteenBitsAreTheNearest, ()) {
    const double x = *rc::gen::oneOf(between(-0.1, 1.1), any_number(-300, 300));
    const double back = static_cast<double>(Unorm16::nearest(x).value) / Unorm16::largest;
    RC_ASSERT(std::abs(back - std::clamp(x, 0.0, 1.0)) <= 0.5001 / Unorm16::largest);
    const glm::dvec3 n = *any_direction();
    RC_ASSERT(glm::distance(glm::dvec3(glm::vec3(PackedNormal::nearest(glm::vec3(n)))), n) < 6.6e-5);
}

// A tree that stays, and what is asked of it.
struct Ball {
    VertexTree tree = support::built(shapes::bumpy_sphere(2));
    DistanceCriterion extent = *extent_criterion(tree, View{}, 40),
                      displacement = *displacement_criterion(tree, View{}, 2);

    static const Ball& get() {
        static const Ball ball;
        return ball;
    }
};

RC_GTEST_PROP(Properties, CostsAreNumbersThatDoNotFallUpTheTree, ()) {
    const Ball& ball = Ball::get();
    const Viewpoint there{.eye = *any_point(-20, 17)};
    for (const DistanceCriterion* criterion : {&ball.extent, &ball.displacement}) {
        const auto costs = find_every_cost(ball.tree, *criterion, there);
        RC_ASSERT(costs.has_value());
        for (NodeId node = 0; node < ball.tree.interior_count(); ++node) {
            RC_ASSERT((*costs)[node] >= 0);
            if (node > 0) {
                const float above = (*costs)[support::sound(ball.tree).parents()[node]];
                RC_ASSERT((*costs)[node] <= above * (1 + 1e-5f));
            }
        }
    }
}

RC_GTEST_PROP(Properties, CutsThatFollowAreThoseFromScratch, ()) {
    const Ball& ball = Ball::get();
    static Cut cut(ball.tree); // one walk through all cases
    static glm::dvec3 eye(0, 0, 5);
    if (*between(0, 1) < 0.3) eye = *any_point(-3, 2);
    else eye += std::pow(10.0, *between(-9, 0)) * *any_direction();
    if (glm::length(eye) > 200) eye = glm::dvec3(0, 0, 5);
    const Viewpoint there{.eye = eye};
    RC_ASSERT(cut.follow(ball.extent, there).has_value());
    RC_ASSERT(support::state_of(cut) == support::from_scratch(ball.tree, ball.extent, there, {}));
}

RC_GTEST_PROP(Properties, BudgetsHold, ()) {
    const Ball& ball = Ball::get();
    static Cut cut(ball.tree);
    const auto budget = *rc::gen::oneOf(rc::gen::resize(rc::kNominalSize, rc::gen::inRange<Index>(0, 400)),
                                        rc::gen::element<Index>(0, 1, ~Index{0}));
    const auto stats = cut.follow(ball.displacement, {.eye = *any_point(-3, 5)},
                                  {.triangle_budget = budget, .hysteresis = static_cast<float>(*between(1, 2))});
    RC_ASSERT(stats.has_value());
    RC_ASSERT(stats->triangles <= budget);
    RC_ASSERT(cut.triangle_count() == stats->triangles);
}

} // namespace
} // namespace unseen::vdtree
