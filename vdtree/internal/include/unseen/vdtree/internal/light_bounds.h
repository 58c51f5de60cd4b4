// What lights make of a tree: the luminance of its vertices, and bounds of it by node.
#pragma once

#include <algorithm>

#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/lighting.h>
#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

std::size_t shadow_lights(const Lighting& lighting); // how many lights cast shadows

// The share of a spot's light within the inner angle, by the cosine of the angle from the axis.
inline double spot_share(const LightSource& spot, double cosine) {
    const double t = std::clamp((cosine - spot.outer_cosine) / (spot.inner_cosine - spot.outer_cosine), 0.0, 1.0);
    return t * t * (3 - 2 * t);
}

// Relative luminance of a vertex. `normal`: unit or zero.
double lit_luminance(const Lighting& lighting, glm::dvec3 position, glm::dvec3 normal, double albedo, glm::dvec3 eye);

// The luminance of a wedge's colour under white light. Without colours: default_albedo, or 1 with a texture.
float albedo_of(const VertexTree& tree, WedgeId wedge);

// Normals and albedos of the vertices that a fold may show: those of the ring, and the proxies of the subtree.
struct VertexCone {
    glm::vec3 axis = glm::vec3(0, 0, 1); // unit; all normals are within the angle from it
    float cosine = 1, sine = 0;          // of the angle; -1 and 0 if normals point anywhere, or one of them is zero
    LuminanceRange albedo;               // multiplied by the texture, if there is one
    // Bounds of the normals' coordinates along the two directions of across_axis(); unused if `largest` is not above
    // `least`. Tighter than the cone: normals differ more along a ridge's curvature than across it.
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

// Needed under lights only: 44 bytes an interior node.
class LightBounds {
public:
    // Fails if VertexTree::check() fails. Cost: about 1 us a triangle, in parallel.
    static Result<LightBounds> measure(const VertexTree& tree);

    // Includes further vertices (wedges); no_node: anything may be here and at all nodes above. `vertices` calls its argument for each
    // of them, from several threads, but not for one node at the same time. Spheres of the `radii` (mesh units, one an
    // interior node) around the rings' centres contain the rings and all further vertices.
    using FurtherVertex = FunctionRef<void(NodeId node, WedgeId vertex)>;
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

// Contains lit_luminance() of every vertex in the sphere whose normal and albedo are in the cone, whichever lights that
// cast shadows are hidden from it. Cost: some ten nanoseconds a light.
LuminanceRange lit_range(const Lighting& lighting, const VertexCone& cone, const Sphere& sphere, glm::dvec3 eye);

// How far lights have moved, in radians: directions by their angle, positions in radii of the tree, intensities by eight
// times their logarithm. With highlights, the eye counts like a light. Infinite if anything else differs.
double light_motion(const VertexTree& tree, const Lighting& from, glm::dvec3 eye_from, const Lighting& to,
                    glm::dvec3 eye_to);

} // namespace unseen::vdtree
