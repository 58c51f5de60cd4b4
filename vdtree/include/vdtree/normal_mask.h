// The normal-cube mask: which directions a set of triangles faces, in 48 bytes.
//
// The Gauss sphere is projected on a cube whose six faces have 8 x 8 cells of equal angle (the cube coordinate is
// warped by the arctangent); one bit per cell. After Luebke and Hallen 2001, section 3.3 (their masks are of the
// same size), and Zhang and Hoff 1997.
#pragma once

#include <array>
#include <cstdint>

#include <glm/vec3.hpp>

namespace unseen::vdtree {

struct NormalMask {
    std::array<std::uint64_t, 6> faces{};

    void insert(int cell) noexcept { faces[static_cast<unsigned>(cell) >> 6] |= std::uint64_t{1} << (cell & 63); }
    bool contains(int cell) const noexcept { return (faces[static_cast<unsigned>(cell) >> 6] >> (cell & 63)) & 1; }
    bool empty() const noexcept {
        return (faces[0] | faces[1] | faces[2] | faces[3] | faces[4] | faces[5]) == 0;
    }
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

// A cone that contains a cell: its axis and its half-angle's sine and cosine, rounded outward.
struct NormalCell {
    glm::vec3 axis;
    float sine;
    float cosine;
};
const std::array<NormalCell, normal_cell_count>& normal_cells() noexcept;

enum class Facing : std::uint8_t { none, front, back, mixed };

// How triangles with the mask's normals, each with a point within `radius` of a centre at distance `distance` and
// direction `to_eye` (unit) from the eye, can face the eye. `mixed` whenever both cannot be ruled out, also when
// the eye is inside the sphere; `none` for an empty mask. Conservative for a perspective view: the directions to
// the eye from points of the sphere differ from `to_eye` by asin(radius / distance) at most. Cost: one product per set cell.
Facing facing(const NormalMask& mask, glm::vec3 to_eye, float distance, float radius) noexcept;

} // namespace unseen::vdtree
