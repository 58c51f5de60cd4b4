// Cells of normal masks, and the sides from which an eye sees the triangles of a mask or of slabs.
#pragma once

#include <algorithm>
#include <cmath>

#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

inline constexpr int normal_cell_count = 384;

// The cell of a direction of any positive length, or -1 for zero and non-finite ones.
int normal_cell(glm::dvec3 normal) noexcept;

// The unit vectors at a cell's corners. Its sides are arcs of great circles, so the cell lies in a cap of the sphere
// (up to a hemisphere) iff its corners do.
struct NormalCell {
    std::array<float, 4> x, y, z;
};
const std::array<NormalCell, normal_cell_count>& normal_cells() noexcept;

enum class Facing : std::uint8_t { none, front, back, mixed };

// How triangles with these normals can face the eye, if each has a point within `radius` of a centre at `distance` from
// the eye. `to_eye`: the unit direction from the centre to the eye. `mixed` unless one side can be ruled out, and always
// inside the sphere; `none` for an empty mask. Conservative for a perspective view: from points of the sphere the direction
// to the eye differs from `to_eye` by asin(radius / distance) at most. Cost of masks: four products per set cell.
Facing facing(const NormalMask& mask, glm::vec3 to_eye, float distance, float radius) noexcept;
Facing facing(const NormalSlabs& slabs, glm::vec3 to_eye, float distance, float radius) noexcept;

// What slabs or mask rule out is ruled out: the slabs first. `mask` may be a function that returns the mask; it is called
// only if the slabs do not decide.
template <class Mask>
Facing facing(const NormalSlabs& slabs, const Mask& mask, glm::vec3 to_eye, float distance, float radius) noexcept {
    const Facing by_slabs = facing(slabs, to_eye, distance, radius);
    if (by_slabs != Facing::mixed) return by_slabs;
    if constexpr (std::is_same_v<Mask, NormalMask>) return facing(mask, to_eye, distance, radius);
    else return facing(mask(), to_eye, distance, radius);
}

// ---- slabs

// Coordinates of a direction along the slabs' axes, in NormalSlabs' order.
template <class Float>
using SlabCoordinates = std::array<Float, NormalSlabs::axis_count>;
template <class Float>
SlabCoordinates<Float> along_slab_axes(Float x, Float y, Float z) noexcept {
    constexpr auto inverse_sqrt3 = static_cast<Float>(0.57735026918962576451); // the diagonals' coordinates
    return {x,
            y,
            z,
            (x + y + z) * inverse_sqrt3,
            (-x + y + z) * inverse_sqrt3,
            (x - y + z) * inverse_sqrt3,
            (x + y - z) * inverse_sqrt3};
}
// Slabs from one to the other, rounded outward; `margin` (units, 1/127) covers the rounding of the coordinates.
template <class Float>
NormalSlabs slabs_between(const SlabCoordinates<Float>& low, const SlabCoordinates<Float>& high,
                          Float margin) noexcept {
    constexpr Float units = 127;
    NormalSlabs slabs;
    for (std::size_t i = 0; i < low.size(); ++i) {
        // The margin must not lead beyond the ends: 128 is no std::int8_t.
        slabs.lo[i] = static_cast<std::int8_t>(std::max(std::floor(low[i] * units - margin), -units));
        slabs.hi[i] = static_cast<std::int8_t>(std::min(std::ceil(high[i] * units + margin), units));
    }
    return slabs;
}

} // namespace unseen::vdtree
