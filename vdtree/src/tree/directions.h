// A set of normals while a tree is being built: its mask, and its slabs in a form whose union is a maximum of bytes.
#pragma once

#include <bit>
#include <cstring>

#include <glm/common.hpp>

#include <unseen/vdtree/internal/normal_mask.h>

namespace unseen::vdtree {

// The borders between the cells of a cube's face lie at equal angles: tan(k pi / 16) for k = 1, 2, 3 and their
// opposites.
inline constexpr double cell_borders[3] = {0.19891236737965800691, 0.41421356237309504880, 0.66817863791929891999};

// Cell of a direction given its largest absolute component, which is positive and finite. Multiplications and
// comparisons only: the same vector always has the same cell, whatever the compiler makes of it, and NormalBatch gives
// the same.
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
    // For each slab two bytes: 128 more than its upper end, and 128 more than its lower end's opposite; 0: nothing yet.
    // In the order in which NormalBatch comes by them; the last two bytes are of no slab.
    using Reach = std::array<std::uint8_t, 16>;
    Reach reach{};

    Directions& operator|=(const Directions& other) noexcept {
        using Bits = std::uint64_t __attribute__((vector_size(16)));
        for (std::size_t i = 0; i < mask.faces.size(); i += 2) {
            Bits mine, theirs;
            std::memcpy(&mine, &mask.faces[i], sizeof(Bits));
            std::memcpy(&theirs, &other.mask.faces[i], sizeof(Bits));
            mine |= theirs;
            std::memcpy(&mask.faces[i], &mine, sizeof(Bits));
        }
        widen(other.reach);
        return *this;
    }
    void widen(const Reach& other) noexcept {
        using Bytes = std::uint8_t __attribute__((vector_size(16)));
        const Bytes mine = std::bit_cast<Bytes>(reach), theirs = std::bit_cast<Bytes>(other);
        reach = std::bit_cast<Reach>(mine > theirs ? mine : theirs);
    }
    static Directions everything() noexcept {
        Directions all;
        all.mask.faces.fill(~std::uint64_t{0});
        all.reach.fill(255);
        all.mark(false);
        return all;
    }
    NormalSlabs slabs() const noexcept {
        NormalSlabs out;
        if (reach[0] == 0) return out;
        for (std::size_t i = 0; i < NormalSlabs::axis_count; ++i) {
            out.hi[i] = static_cast<std::int8_t>(reach[upper_end(i)] - 128);
            out.lo[i] = static_cast<std::int8_t>(128 - reach[upper_end(i) + 1]);
        }
        return out;
    }

    // A mark that unions keep: one more fact for the code that collects directions.
    void mark(bool marked) noexcept { reach[mark_byte] = marked ? 1 : 0; }
    bool marked() const noexcept { return reach[mark_byte] != 0; }

private:
    static constexpr std::size_t mark_byte = 15;
    static constexpr std::size_t upper_end(std::size_t slab) noexcept { return slab % 4 * 4 + slab / 4 * 2; }
};

// A corner of a triangle: x, y and z, and a fourth number that does not matter.
using Corner = float __attribute__((vector_size(16)));

// Finds the directions of the normals of many triangles at once: several per instruction.
class NormalBatch {
public:
    static constexpr std::size_t capacity = 64;

    bool full() const noexcept { return count_ == capacity; }
    std::size_t size() const noexcept { return count_; }
    // Without a branch on whether it counts.
    void push_if(bool counts, Corner a, Corner b, Corner c) noexcept {
        triangles_[count_][0] = a;
        triangles_[count_][1] = b;
        triangles_[count_][2] = c;
        count_ += counts;
    }

    // Measures what was pushed and empties the batch; the results stay until the next call.
    void measure() noexcept;
    // Adds the direction of the i-th triangle; none if it has no area.
    void insert(std::size_t i, Directions& to) const noexcept {
        if (cells_[i] < 0) return;
        to.mask.insert(cells_[i]);
        to.widen(reach_[i]);
    }

private:
    std::size_t count_ = 0;
    alignas(64) Corner triangles_[capacity][3];
    alignas(64) int cells_[capacity];
    alignas(64) Directions::Reach reach_[capacity];
};

} // namespace unseen::vdtree
