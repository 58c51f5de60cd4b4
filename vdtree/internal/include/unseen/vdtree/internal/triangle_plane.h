// The plane of a triangle, from which displacements are measured.
#pragma once

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace unseen::vdtree {

// The unit normal, or zero where the triangle is thinner than this share of its length: coordinates in floats do not tell
// where it faces.
inline glm::dvec3 plane_normal(glm::dvec3 a, glm::dvec3 b, glm::dvec3 c) noexcept {
    constexpr double least_height = 0x1p-26;
    const glm::dvec3 ab = b - a, bc = c - b, ca = a - c, normal = glm::cross(ab, bc);
    const double length2 = std::max({glm::dot(ab, ab), glm::dot(bc, bc), glm::dot(ca, ca)});
    const double twice_area = glm::length(normal);
    return twice_area > least_height * length2 ? normal / twice_area : glm::dvec3(0);
}

// Added to displacements, as a share of the support sphere's radius: covers the rounding of normals to floats.
inline constexpr double displacement_rounding = 0x1p-22;

} // namespace unseen::vdtree
