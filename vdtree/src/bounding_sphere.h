// Small enclosing spheres of points and of spheres.
#pragma once

#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include <vdtree/vertex_tree.h>

namespace unseen::vdtree {

struct DSphere {
    glm::dvec3 centre = glm::dvec3(0);
    double radius = -1; // negative: contains nothing
};

// The smallest sphere that contains all points (Welzl 1991, move to front). Deterministic.
// Cost: expected linear for the sizes used here (tens of points).
DSphere smallest_sphere(std::span<const glm::dvec3> points);

// Nearly the smallest sphere that contains all points and all spheres: the radius exceeds the smallest one by a
// relative 1e-4 at most, and contains them all.
DSphere enclosing_sphere(std::span<const glm::dvec3> points, std::span<const DSphere> spheres);

// The sphere in floats, grown so that it contains the given one in exact arithmetic.
Sphere round_outward(const DSphere& sphere);

} // namespace unseen::vdtree
