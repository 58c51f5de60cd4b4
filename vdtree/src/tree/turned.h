// Whether a triangle is turned over.
#pragma once

#include <array>
#include <cmath>

#include <glm/geometric.hpp>

namespace unseen::vdtree {

// Texture coordinates of thinner triangles than this, as the sine of the angle between two sides, have no side to speak of.
inline constexpr float least_uv_sine = 1e-3f;

// Twice the area of a triangle in the texture, positive where it runs counter-clockwise; 0 where it is too thin.
inline float uv_area(const std::array<glm::vec2, 3>& uvs) {
    const glm::vec2 e = uvs[1] - uvs[0], f = uvs[2] - uvs[0];
    const float area = e.x * f.y - e.y * f.x;
    return area * area > least_uv_sine * least_uv_sine * glm::dot(e, e) * glm::dot(f, f) ? area : 0;
}

// Against its corners in the mesh: whether it faces away from where it faced, or is mirrored in the texture.
class TurnedTest {
public:
    using Positions = std::array<glm::vec3, 3>;
    using Uvs = std::array<glm::vec2, 3>;

    TurnedTest(const Positions& positions, const Uvs& uvs)
        : normal_(normal_of(positions)), uv_area_(vdtree::uv_area(uvs)) {}

    bool is_turned(const Positions& positions) const { return glm::dot(normal_of(positions), normal_) < 0; }
    bool is_mirrored(const Uvs& uvs) const {
        return uv_area_ != 0 && (uv_area_ > 0 ? vdtree::uv_area(uvs) < 0 : vdtree::uv_area(uvs) > 0);
    }

    const glm::dvec3& normal() const { return normal_; }
    float uv_area() const { return uv_area_; }

private:
    // Not normalised, and in double, for triangles of a large model may be tiny.
    static glm::dvec3 normal_of(const Positions& p) {
        const glm::dvec3 a(p[0]);
        return glm::cross(glm::dvec3(p[1]) - a, glm::dvec3(p[2]) - a);
    }

    glm::dvec3 normal_;
    float uv_area_;
};

} // namespace unseen::vdtree
