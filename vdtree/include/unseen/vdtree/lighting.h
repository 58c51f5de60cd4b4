// Lights that may move, and what they make of a tree: the luminance of its vertices, and bounds of it by node.
//
// Surfaces are matt (Lambert) with a highlight (Blinn and Phong, normalised so that a sharper highlight is a brighter
// one). Shadows are no part of the formula: what draws takes the share of a light that casts_shadow away where the light
// is hidden. The relative luminance of a vertex at x with the normal n and the albedo a, lit from the
// directions l and seen from v:
//     ambient a + sum over lights of E max(0, n.l) (a + specular (shininess + 8) / 8 max(0, n.h)^shininess),
//     h = (l + v) / |l + v|,
// cut off at 1, where the display ends. E is the light's intensity; for point and spot lights times (distance /
// |position - x|)^2, and for spots times the smooth step of the cosine of the angle from their axis, from 0 at the
// outer one to 1 at the inner one. A vertex without a normal has the ambient light alone. In between, luminance is
// interpolated linearly.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

// In a tree's frame: relative to its origin, lengths in mesh units.
struct LightSource {
    enum class Kind : std::uint8_t { directional, point, spot };
    Kind kind = Kind::directional;
    double intensity = 1; // relative luminance of white that faces the light, at `distance` from it
    glm::dvec3 direction = glm::dvec3(0, 0, 1); // unit; of a directional light: towards it, of a spot: where it shines
    glm::dvec3 position = glm::dvec3(0);        // of a point or spot light
    double distance = 1;                        // likewise
    double inner_cosine = 1, outer_cosine = 0;  // of a spot: full light within the inner, none beyond the outer angle
    bool casts_shadow = false;                  // what is behind something, seen from the light, is not lit by it
    bool operator==(const LightSource&) const = default;
};

struct Lighting {
    std::vector<LightSource> lights;
    double ambient = 0;  // relative luminance of white without any other light
    double specular = 0; // 0: no highlights
    double shininess = 32;
    bool operator==(const Lighting&) const = default;
};
inline constexpr std::size_t most_lights = 16;
inline constexpr std::size_t most_shadow_lights =
    4; // that cast shadows: each has maps of its own, and its own share of
       // every vertex's light
inline constexpr double most_shininess = 1024;

// Not negative, intensities up to 1e12, distances and places up to 1e18 mesh units, directions of unit length, angles
// in order, not all dark, and at most most_shadow_lights that cast shadows. The error names the field, as in "lights[2].distance".
Result<void> validate(const Lighting& lighting);

std::size_t shadow_lights(const Lighting& lighting); // how many lights cast shadows

// validate(), and no light at a vertex, where its direction is not defined, or within a closed surface, of which it can
// light nothing that is seen. Cost: of a light within the bounding sphere, a descent and three rays through the tree.
Result<void> check_lights(const VertexTree& tree, const Lighting& lighting);

// Relative luminance of a vertex. `normal`: unit or zero.
double lit_luminance(const Lighting& lighting, glm::dvec3 position, glm::dvec3 normal, double albedo, glm::dvec3 eye);

// Of white light: the luminance of a node's colour, or default_albedo; with a texture, which is multiplied with it, 1
// in its place.
float albedo_of(const VertexTree& tree, NodeId node);

// What the vertices have that a fold may show: those of the ring, and the proxies of the subtree.
struct VertexCone {
    glm::vec3 axis = glm::vec3(0, 0, 1); // unit; all normals are within the angle from it
    float cosine = 1, sine = 0;          // of the angle; -1 and 0 where they point anywhere, or one of them is zero
    LuminanceRange albedo;               // with the texture's share, if there is one
    // Coordinates of the normals along two directions across the axis, across_axis(); of no account where `largest` is
    // not above `least`. Normals differ more along a ridge's curvature than across it, and seldom by as much as the
    // cone allows.
    float least_across[2] = {0, 0}, largest_across[2] = {0, 0};
    bool has_box() const noexcept { return largest_across[0] > least_across[0]; }
};

// Two unit vectors that make an orthonormal frame with a unit vector (Duff and others 2017, "Building an Orthonormal
// Basis, Revisited").
inline void across_axis(const glm::vec3& axis, glm::vec3& first, glm::vec3& second) noexcept {
    const float sign = axis.z < 0 ? -1.0f : 1.0f, a = -1 / (sign + axis.z), b = axis.x * axis.y * a;
    first = {1 + sign * axis.x * axis.x * a, sign * b, -sign * axis.x};
    second = {b, sign + axis.y * axis.y * a, -axis.y};
}

// Needed where lights are, and only there: 44 bytes an interior node.
class LightBounds {
public:
    // Fails where VertexTree::check() does. Cost: about 1 us a triangle, in parallel; does not depend on the threads.
    static Result<LightBounds> measure(const VertexTree& tree);

    // Of further vertices as well: `vertices` calls its argument for each, as often as it likes and from as many
    // threads, but from one at a time for one node. no_node as a vertex: anything may be there, and at
    // all nodes above.
    using FurtherVertex = FunctionRef<void(NodeId node, NodeId vertex)>;
    // `radii`: by interior node, mesh units, of spheres around the rings' centres that hold the rings and all of these.
    // Programmer's error: fewer radii than nodes.
    static Result<LightBounds> measure(const VertexTree& tree, std::vector<float> radii,
                                       const FunctionRef<void(const FurtherVertex&)>& vertices);

    std::span<const VertexCone> cones() const noexcept { return cones_; } // by interior node
    std::span<const float> radii() const noexcept { return radii_; }      // likewise; empty: the rings' own

    // Where the node's vertices are.
    Sphere sphere(const VertexTree& tree, NodeId node) const {
        const Sphere ring = tree.bounds()[node].ring;
        return {ring.centre, radii_.empty() ? ring.radius : radii_[node]};
    }

private:
    std::vector<VertexCone> cones_;
    std::vector<float> radii_;
};

// Contains lit_luminance() of every vertex in the sphere whose normal and albedo are in the cone, whichever of the lights
// that cast shadows are hidden from it. Larger for larger
// spheres and cones without boxes. Cost: some ten nanoseconds a light.
LuminanceRange lit_range(const Lighting& lighting, const VertexCone& cone, const Sphere& sphere, glm::dvec3 eye);

// How far lights have moved, as an angle in radians: of the directions of directional lights and spots; positions count
// in radii of the tree; intensities by eight times their logarithm; with highlights, the eye like a light. Infinite
// where anything else differs.
double light_motion(const VertexTree& tree, const Lighting& from, glm::dvec3 eye_from, const Lighting& to,
                    glm::dvec3 eye_to);

} // namespace unseen::vdtree
