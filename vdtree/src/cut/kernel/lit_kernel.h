// The arithmetic of lights, sixteen nodes at once: between which luminances a node's vertices are, and how far the
// lights may move before that differs by so much.
#pragma once

#include <vector>

#include <unseen/vdtree/internal/light_bounds.h>
#include <unseen/vdtree/lighting.h>

#include "cut/kernel/fold_kernel.h"

namespace unseen::vdtree {

// Lights as the kernel wants them.
struct KernelLights {
    struct Light {
        LightSource::Kind kind;
        bool casts_shadow; // and so may be hidden
        float direction[3], position[3];
        float intensity, distance;              // of point lights and spots: at that distance
        float inner_cosine, outer_cosine, fade; // of a spot; most change of its step in a radian
        float inexact;                          // a bound of the position's rounding, mesh units
    };
    std::vector<Light> lights;
    float ambient = 0;
    float specular = 0; // with its normalisation
    float shininess = 1;
    float eye[3] = {0, 0, 0};
    float eye_inexact = 0;
    float radius = 1; // of the tree, mesh units: of what light_motion() counts as 1

    KernelLights() = default;
    KernelLights(const VertexTree& tree, const Lighting& lighting, glm::dvec3 eye);
    // Without a tree, only for ranges.
    KernelLights(const Lighting& lighting, glm::dvec3 eye, double tree_radius);
};

// Sixteen nodes.
struct LitBatch {
    alignas(64) float axis[3][kernel_lanes];
    alignas(64) float cosine[kernel_lanes], sine[kernel_lanes];
    // Across the axis, from one normal to all others: least and largest coordinates along two directions. Without a
    // box: beyond any normal's.
    alignas(64) float across[2][3][kernel_lanes], least_across[2][kernel_lanes], largest_across[2][kernel_lanes];
    alignas(64) float steepness[kernel_lanes],
        spread[kernel_lanes]; // of the box's bounds: most change in a radian; of their difference
    alignas(64) float least_albedo[kernel_lanes], largest_albedo[kernel_lanes];
    alignas(64) float centre[3][kernel_lanes], radius[kernel_lanes];
    void set(std::size_t lane, const VertexCone& cone, const Sphere& sphere) noexcept;

    // Out, by find_ranges():
    alignas(64) float lo[kernel_lanes], hi[kernel_lanes];
    // While the lights move by m, m <= cap (see light_motion()): hi - lo changes by at most jump + fine_rate m for m <=
    // fine_cap, and by at most rough_rate for each further unit; hi + lo by 2 jump and at the rates fine_sum_rate and
    // full_rate; and hi by jump + rise_rate m.
    alignas(64) float cap[kernel_lanes], fine_cap[kernel_lanes];
    alignas(64) float fine_rate[kernel_lanes], rough_rate[kernel_lanes],
        fine_sum_rate[kernel_lanes], full_rate[kernel_lanes];
    alignas(64) float rise_rate[kernel_lanes], jump[kernel_lanes];
};
void find_ranges(const KernelLights& lights, LitBatch& batch) noexcept;

} // namespace unseen::vdtree
