// How far the eye is from where a set of normals would face it otherwise, for many sets at once.
#pragma once

#include <array>
#include <cstdint>

#include <vdtree/normal_mask.h>

namespace unseen::vdtree {

inline constexpr std::size_t facing_lanes = 16;

// Sixteen rings: their slabs, the vectors from the centres of their spheres to the eye, and the spheres' radii.
struct FacingBatch {
    alignas(64) std::int8_t lo[NormalSlabs::axis_count * facing_lanes]; // [axis * lanes + lane]
    alignas(64) std::int8_t hi[NormalSlabs::axis_count * facing_lanes];
    alignas(64) float to_eye[3][facing_lanes];
    alignas(64) float radius[facing_lanes];

    void set(std::size_t lane, const NormalSlabs& slabs, float x, float y, float z, float r) noexcept {
        for (std::size_t axis = 0; axis < NormalSlabs::axis_count; ++axis) {
            lo[axis * facing_lanes + lane] = slabs.lo[axis];
            hi[axis * facing_lanes + lane] = slabs.hi[axis];
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
    alignas(64) float front[facing_lanes];
    alignas(64) float back[facing_lanes];
};
void facing_gaps(const FacingBatch& batch, FacingGaps& gaps) noexcept;

} // namespace unseen::vdtree
