// How far a point is from a triangle.
#pragma once

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace unseen::support {

inline double distance_to_segment(glm::dvec3 p, glm::dvec3 a, glm::dvec3 b) {
    const double squared = glm::dot(b - a, b - a);
    const double t = squared > 0 ? std::clamp(glm::dot(p - a, b - a) / squared, 0.0, 1.0) : 0.0;
    return glm::distance(p, a + t * (b - a));
}

inline double distance_to_triangle(glm::dvec3 p, glm::dvec3 a, glm::dvec3 b, glm::dvec3 c) {
    const glm::dvec3 n = glm::cross(b - a, c - a);
    const double squared = glm::dot(n, n);
    if (squared > 0 && glm::dot(glm::cross(b - a, p - a), n) >= 0 && glm::dot(glm::cross(c - b, p - b), n) >= 0 &&
        glm::dot(glm::cross(a - c, p - c), n) >= 0)
        return std::abs(glm::dot(p - a, n)) / std::sqrt(squared);
    return std::min({distance_to_segment(p, a, b), distance_to_segment(p, b, c), distance_to_segment(p, c, a)});
}

} // namespace unseen::support
