#include <unseen/vdtree/vertex_tree.h>

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

namespace unseen::vdtree {

namespace {

// The lower half of the octahedron, folded over the edges of the upper one. Its own inverse but for signs of zero.
template <class T>
glm::vec<2, T> fold_over(T x, T y) {
    return {(1 - std::abs(y)) * (x < 0 ? T(-1) : T(1)), (1 - std::abs(x)) * (y < 0 ? T(-1) : T(1))};
}

} // namespace

PackedNormal PackedNormal::nearest(glm::vec3 direction) noexcept {
    const glm::dvec3 n(direction);
    const double size = std::abs(n.x) + std::abs(n.y) + std::abs(n.z);
    if (!(size > 0) || !std::isfinite(size)) return {};
    glm::dvec2 p(n.x / size, n.y / size);
    if (n.z < 0) p = fold_over(p.x, p.y);
    const auto rounded = [](double v) {
        return static_cast<std::int16_t>(std::clamp(v, -1.0, 1.0) * largest + std::copysign(0.5, v));
    };
    return {rounded(p.x), rounded(p.y)};
}

PackedNormal::operator glm::vec3() const noexcept {
    if (x == none || y == none) return glm::vec3(0);
    glm::vec2 p(static_cast<float>(x) / largest, static_cast<float>(y) / largest);
    const float z = 1 - std::abs(p.x) - std::abs(p.y);
    if (z < 0) p = fold_over(p.x, p.y);
    return glm::normalize(glm::vec3(p, z)); // at least 1/sqrt(3) long
}

} // namespace unseen::vdtree
