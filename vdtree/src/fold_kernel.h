// The arithmetic of fold tests, sixteen nodes at once: where their spheres are, seen from the eye, and how far the eye is from
// where their rings would face it otherwise.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <vdtree/normal_mask.h>

namespace unseen::vdtree {

inline constexpr std::size_t kernel_lanes = 16;

// What all nodes are measured from.
struct KernelView {
    float eye_high[3], eye_low[3]; // the eye in two floats each: differences to it stay good near and far
    float gaze[3];                 // unit
    bool has_gaze = false;
    // Planes of the frusta through the eye's frame: normal . (p - eye) + offset; those of frustum f are
    // [first_plane[f], first_plane[f + 1]).
    struct Plane {
        float normal[3], offset;
    };
    std::vector<Plane> planes;
    std::vector<std::size_t> first_plane;
};

// Sixteen spheres, and what is measured of them.
struct SphereBatch {
    alignas(64) float centre[3][kernel_lanes];
    alignas(64) float radius[kernel_lanes];
    // Out:
    alignas(64) float to_eye[3][kernel_lanes];      // from the centre
    alignas(64) float distance[kernel_lanes];       // of the centre
    alignas(64) float gap[kernel_lanes];            // of the sphere: distance - radius
    alignas(64) float eccentricity[kernel_lanes];   // radians, of the sphere's nearest point to the gaze; 0 from inside, and without gaze
    alignas(64) float height[kernel_lanes];         // of the sphere's top over the lowest plane of the best frustum; negative: outside
                                                    // of all. Without frusta: huge
};
void measure(const KernelView& view, SphereBatch& batch) noexcept;

// Sixteen rings: their slabs, the vectors from the centres of their spheres to the eye, and the spheres' radii.
struct FacingBatch {
    alignas(64) std::int8_t lo[NormalSlabs::axis_count * kernel_lanes]; // [axis * lanes + lane]
    alignas(64) std::int8_t hi[NormalSlabs::axis_count * kernel_lanes];
    alignas(64) float to_eye[3][kernel_lanes];
    alignas(64) float radius[kernel_lanes];

    void set(std::size_t lane, const NormalSlabs& slabs, float x, float y, float z, float r) noexcept {
        for (std::size_t axis = 0; axis < NormalSlabs::axis_count; ++axis) {
            lo[axis * kernel_lanes + lane] = slabs.lo[axis];
            hi[axis * kernel_lanes + lane] = slabs.hi[axis];
        }
        to_eye[0][lane] = x, to_eye[1][lane] = y, to_eye[2][lane] = z;
        radius[lane] = r;
    }
};

// By how much (mesh units) the eye could move, in any direction, while everything in the slabs still faces it (front), or
// still faces away (back), from every point of the sphere. Not positive: not everything does; then it is minus the path after
// which everything might.
//
// Conservative: a positive gap is a proof. The slabs are relaxed to parallelepipeds P, any one of which may prove it:
// min over x in P of x . (eye - centre) > radius * reach, where `reach` bounds the length of every vector in P. Parallelepipeds that
// reach farther than `widest_reach` are not tried, so that one constant serves all: then a node without a proof has no ancestor with
// one, for moving the centre by the difference of the radii changes x . (eye - centre) by at most reach times that.
struct FacingGaps {
    alignas(64) float front[kernel_lanes];
    alignas(64) float back[kernel_lanes];
};
void facing_gaps(const FacingBatch& batch, FacingGaps& gaps) noexcept;

} // namespace unseen::vdtree
