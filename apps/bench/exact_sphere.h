// The smallest sphere around points by exact arithmetic, as an oracle.
#pragma once

#include <span>

#include <glm/vec3.hpp>

#include "build/bounding_sphere.h" // vdtree's own

namespace unseen::app {

bool has_exact_spheres(); // whether this build has CGAL

// Precondition: it has. The radius is the exact one, rounded to double at the end. Cost: a microsecond a point and more.
vdtree::DSphere exact_sphere(std::span<const glm::dvec3> points);

} // namespace unseen::app
