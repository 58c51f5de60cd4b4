// A set of normals while a tree is being built: its mask, and its slabs in a form whose union is a maximum of bytes.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include <vdtree/normal_mask.h>

namespace unseen::vdtree {

// The borders between the cells of a cube's face lie at equal angles: tan(k pi / 16) for k = 1, 2, 3 and their opposites.
inline constexpr double cell_borders[3] = {0.19891236737965800691, 0.41421356237309504880, 0.66817863791929891999};

// Cell of a direction given its largest absolute component, which is positive and finite. Multiplications and comparisons
// only: the same vector always has the same cell, whatever the compiler makes of it.
inline int cell_of(glm::dvec3 v, double largest) noexcept {
    const glm::dvec3 size = glm::abs(v);
    const int axis = size.x >= size.y ? (size.x >= size.z ? 0 : 2) : (size.y >= size.z ? 1 : 2);
    const double b0 = cell_borders[0] * largest, b1 = cell_borders[1] * largest, b2 = cell_borders[2] * largest;
    const auto index = [&](double along) {
        const double a = std::abs(along);
        const int steps = (a >= b0) + (a >= b1) + (a >= b2);
        return along < 0 ? 3 - steps : 4 + steps;
    };
    constexpr int next[3] = {1, 2, 0};
    const int face = axis * 2 + (v[axis] < 0 ? 1 : 0);
    return face * 64 + index(v[next[next[axis]]]) * 8 + index(v[next[axis]]);
}

struct alignas(64) Directions {
    NormalMask mask;
    // By slab: 128 more than its upper end, then 128 more than its lower end's opposite; 0: nothing yet.
    std::array<std::uint8_t, 16> reach{};

    // Takes the direction of a cross product of differences of floats: no overflow when squared. Zero says nothing.
    void insert(glm::dvec3 normal) noexcept {
        const double largest = std::max({std::abs(normal.x), std::abs(normal.y), std::abs(normal.z)});
        if (!(largest > 0)) return;
        mask.insert(cell_of(normal, largest));
        const double scale = units / std::sqrt(glm::dot(normal, normal));
        const float x = static_cast<float>(normal.x * scale), y = static_cast<float>(normal.y * scale),
                    z = static_cast<float>(normal.z * scale);
        constexpr float s = 0.57735026918962576f;
        const float along[8] = {x, y, z, (x + y + z) * s, (y + z - x) * s, (x - y + z) * s, (x + y - z) * s, -units};
        for (std::size_t i = 0; i < 8; ++i) {
            // Whole units outward: what is cut off below the end of the scale.
            const auto high = static_cast<std::uint8_t>(255 - static_cast<int>(units - margin - along[i]));
            const auto low = static_cast<std::uint8_t>(255 - static_cast<int>(units - margin + along[i]));
            reach[i] = std::max(reach[i], high);
            reach[8 + i] = std::max(reach[8 + i], low);
        }
    }
    Directions& operator|=(const Directions& other) noexcept {
        mask |= other.mask;
        for (std::size_t i = 0; i < reach.size(); ++i) reach[i] = std::max(reach[i], other.reach[i]);
        return *this;
    }
    static Directions everything() noexcept {
        Directions all;
        all.mask.faces.fill(~std::uint64_t{0});
        all.reach.fill(255);
        return all;
    }
    NormalSlabs slabs() const noexcept {
        NormalSlabs out;
        if (reach[0] == 0) return out;
        for (std::size_t i = 0; i < NormalSlabs::axis_count; ++i) {
            out.hi[i] = static_cast<std::int8_t>(reach[i] - 128);
            out.lo[i] = static_cast<std::int8_t>(128 - reach[8 + i]);
        }
        return out;
    }

private:
    static constexpr float units = 127;   // of NormalSlabs in 1
    static constexpr float margin = 1e-4f; // units; covers the rounding of unit vectors in floats
};

} // namespace unseen::vdtree
