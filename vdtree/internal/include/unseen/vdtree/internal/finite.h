// Whether vectors are numbers.
#pragma once

#include <cmath>

#include <glm/vec3.hpp>

namespace unseen::vdtree {

template <class T>
bool is_finite(const glm::vec<3, T>& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

} // namespace unseen::vdtree
