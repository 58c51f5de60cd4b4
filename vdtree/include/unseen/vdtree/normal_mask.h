// Normal masks and slabs: which directions a set of triangles faces, in 48 bytes.
//
// The Gauss sphere is projected on a cube whose six faces have 8 x 8 cells of equal angle (the cube coordinate is
// warped by the arctangent); one bit per cell. After Luebke and Hallen 2001, section 3.3 (their masks are of the
// same size), and Zhang and Hoff 1997.
#pragma once

#include <array>
#include <cstdint>
#include <type_traits>

#include <glm/vec3.hpp>

namespace unseen::vdtree {

struct NormalMask {
    std::array<std::uint64_t, 6> faces{};

    void insert(int cell) noexcept { faces[static_cast<unsigned>(cell) >> 6] |= std::uint64_t{1} << (cell & 63); }
    bool contains(int cell) const noexcept { return (faces[static_cast<unsigned>(cell) >> 6] >> (cell & 63)) & 1; }
    bool empty() const noexcept { return (faces[0] | faces[1] | faces[2] | faces[3] | faces[4] | faces[5]) == 0; }
    NormalMask& operator|=(const NormalMask& other) noexcept {
        for (std::size_t i = 0; i < 6; ++i) faces[i] |= other.faces[i];
        return *this;
    }
    bool includes(const NormalMask& other) const noexcept {
        std::uint64_t missing = 0;
        for (std::size_t i = 0; i < 6; ++i) missing |= other.faces[i] & ~faces[i];
        return missing == 0;
    }
    bool operator==(const NormalMask&) const = default;
};

inline constexpr int normal_cell_count = 384;

// The cell of a direction of any positive length, or -1 for zero and non-finite ones.
int normal_cell(glm::dvec3 normal) noexcept;

// The unit vectors at a cell's corners. Its sides are arcs of great circles, so the cell lies in a cap of the sphere
// (up to a hemisphere) iff its corners do.
struct NormalCell {
    std::array<float, 4> x, y, z;
};
const std::array<NormalCell, normal_cell_count>& normal_cells() noexcept;

// Slabs that contain the same directions as a mask, in 14 bytes: the least and the largest coordinate along the three
// axes and the four diagonals of the cube, in 1/127, rounded outward. Cheaper to test than the mask, and much tighter
// where the directions are alike; unions are exact, so nothing is lost up the tree.
struct NormalSlabs {
    static constexpr int axis_count = 7; // x, y, z, then the diagonals (1,1,1), (-1,1,1), (1,-1,1), (1,1,-1)
    std::array<std::int8_t, axis_count> lo{127, 127, 127, 127, 127, 127, 127};
    std::array<std::int8_t, axis_count> hi{-127, -127, -127, -127, -127, -127, -127};

    void insert(glm::dvec3 unit_normal) noexcept;
    bool empty() const noexcept { return lo[0] > hi[0]; }
    NormalSlabs& operator|=(const NormalSlabs& other) noexcept {
        for (std::size_t i = 0; i < axis_count; ++i) {
            lo[i] = lo[i] < other.lo[i] ? lo[i] : other.lo[i];
            hi[i] = hi[i] > other.hi[i] ? hi[i] : other.hi[i];
        }
        return *this;
    }
    bool includes(const NormalSlabs& other) const noexcept {
        NormalSlabs both = *this;
        return (both |= other) == *this;
    }
    static NormalSlabs everything() noexcept {
        NormalSlabs all;
        all.lo.fill(-127);
        all.hi.fill(127);
        return all;
    }
    bool operator==(const NormalSlabs&) const = default;
};

enum class Facing : std::uint8_t { none, front, back, mixed };

// How triangles with the mask's normals, each with a point within `radius` of a centre at distance `distance` and
// direction `to_eye` (unit) from the eye, can face the eye. `mixed` whenever both cannot be ruled out, also when
// the eye is inside the sphere; `none` for an empty mask. Conservative for a perspective view: the directions to
// the eye from points of the sphere differ from `to_eye` by asin(radius / distance) at most. Cost: four products per
// set cell.
Facing facing(const NormalMask& mask, glm::vec3 to_eye, float distance, float radius) noexcept;
Facing facing(const NormalSlabs& slabs, glm::vec3 to_eye, float distance, float radius) noexcept;

// Both hold, so what either rules out is ruled out: the slabs first. `mask` may be a function that gives the mask; it
// is called only where the slabs do not decide.
template <class Mask>
Facing facing(const NormalSlabs& slabs, const Mask& mask, glm::vec3 to_eye, float distance, float radius) noexcept {
    const Facing by_slabs = facing(slabs, to_eye, distance, radius);
    if (by_slabs != Facing::mixed) return by_slabs;
    if constexpr (std::is_same_v<Mask, NormalMask>) return facing(mask, to_eye, distance, radius);
    else return facing(mask(), to_eye, distance, radius);
}

} // namespace unseen::vdtree
