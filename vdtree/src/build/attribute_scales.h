// What attributes count as against lengths in the unit box, when clusters are contracted and when their wedges get
// values.
#pragma once

#include <cmath>

#include <glm/geometric.hpp>

#include <unseen/vdtree/mesh.h>

namespace unseen::vdtree {

// A normal that turns by one radian counts as this share of the model's extent. Half as much lets the surface of smooth
// models stray 10% less for their triangles, but their shading looks worse; with twice as much it strays 25% farther.
inline constexpr double normal_scale = 0.005;
// One unit of relative luminance, and a colour that goes from 0 to 1, count as these shares of the extent. From 0.01 to
// 0.2, the triangles that the perceptual fold test leaves differ by 0.5%; but with 0.2 the surface strays 1.3 to 1.7
// times as far for its triangles, for luminance then drowns the shape.
inline constexpr double luminance_scale = 0.01;
inline constexpr double colour_scale = 0.005;
// A texture that slides by a length on the surface counts as this share of the length: what one sees of it depends on
// the texture, and most of a displacement is seen whatever it is.
inline constexpr double texture_scale = 0.3;

// The length that one unit of texture coordinates covers, on average; 0 where they cover nothing. `place_of`: by leaf.
template <class PlaceOf>
double texture_density(std::span<const Triangle> triangles, std::span<const glm::vec2> uvs, PlaceOf&& place_of) {
    double surface = 0, texture = 0;
    for (const Triangle& t : triangles) {
        const glm::dvec3 a = place_of(t[0]);
        surface += glm::length(glm::cross(place_of(t[1]) - a, place_of(t[2]) - a));
        const glm::dvec2 uv(uvs[t[0]]), e = glm::dvec2(uvs[t[1]]) - uv, f = glm::dvec2(uvs[t[2]]) - uv;
        texture += std::abs(e.x * f.y - e.y * f.x);
    }
    const double density = std::sqrt(surface / texture);
    return density > 0 && std::isfinite(density) ? density : 0;
}

} // namespace unseen::vdtree
