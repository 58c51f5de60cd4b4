// Vectors that may be NaN, infinite, tiny or huge.
#pragma once

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace unseen::vdtree {

template <class T>
bool is_finite(const glm::vec<3, T>& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

// The direction of a vector of any length. Zero for zero and for non-finite vectors. Scaled by the largest component first, so that neither tiny nor huge
// vectors under- or overflow when squared.
inline glm::dvec3 unit(glm::dvec3 v) {
    const double largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
    return largest > 0 && std::isfinite(largest) ? glm::normalize(v / largest) : glm::dvec3(0);
}

} // namespace unseen::vdtree
