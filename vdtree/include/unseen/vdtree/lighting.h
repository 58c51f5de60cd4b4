// Lights that may move, and the luminance that they give to a vertex.
//
// Surfaces are matt (Lambert) with a highlight (Blinn and Phong, normalised so that a sharper highlight is brighter). The
// relative luminance of a vertex at x with the normal n and the albedo a, lit from the directions l and seen from v, is
//     ambient a + sum over lights of E max(0, n.l) (a + specular (shininess + 8) / 8 max(0, n.h)^shininess),
//     h = (l + v) / |l + v|,
// clipped at 1, the display's white. E is the light's intensity; for point and spot lights times (distance /
// |position - x|)^2, and for spots also times a smooth step of the cosine of the angle from their axis: 0 at the outer
// angle, 1 at the inner one. A vertex without a normal gets the ambient light alone. Shadows are not part of the formula:
// the renderer takes away the share of each light that is hidden.
#pragma once

#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

// In a tree's frame: relative to its origin, lengths in mesh units.
struct LightSource {
    enum class Kind : std::uint8_t { directional, point, spot };
    Kind kind = Kind::directional;
    double intensity = 1; // relative luminance of white that faces the light, at `distance` from it
    glm::dvec3 direction = glm::dvec3(0, 0, 1); // unit; towards a directional light, but along a spot's beam
    glm::dvec3 position = glm::dvec3(0);        // point and spot lights only
    double distance = 1;                        // point and spot lights only
    double inner_cosine = 1, outer_cosine = 0;  // spots only: full light inside the inner angle, none outside the outer
    bool casts_shadow = false;
    bool operator==(const LightSource&) const = default;
};

struct Lighting {
    std::vector<LightSource> lights;
    double ambient = 0;  // relative luminance of white under no other light
    double specular = 0; // 0: no highlights
    double shininess = 32;
    bool operator==(const Lighting&) const = default;
};
inline constexpr std::size_t most_lights = 16;
inline constexpr std::size_t most_shadow_lights = 4; // each has its own shadow maps
inline constexpr double most_shininess = 1024;

// Nothing may be negative; intensities are at most 1e12, distances and positions at most 1e18 mesh units; directions have
// unit length; angles are in order; some light is not dark; at most most_shadow_lights cast shadows. The error names the
// field, such as "lights[2].distance".
Result<void> validate(const Lighting& lighting);

// validate(), and no light may lie at a vertex, where its direction is undefined, or inside a closed surface, of which it
// would light nothing visible. Cost for a light within the bounding sphere: a descent and three rays through the tree.
Result<void> check_lights(const VertexTree& tree, const Lighting& lighting);

} // namespace unseen::vdtree
