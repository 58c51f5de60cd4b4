// Cells of normal masks, and the sides from which an eye sees the triangles of a mask or of slabs.
#pragma once

#include <array>
#include <cstdint>
#include <type_traits>

#include <glm/vec3.hpp>

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

} // namespace unseen::vdtree
