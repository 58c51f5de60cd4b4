// Where points lie: boxes, Morton codes, and a radix sort for these.
#pragma once

#include <algorithm>
#include <functional>

#include <glm/common.hpp>

#include <unseen/vdtree/mesh.h>

namespace unseen::vdtree {

struct Box {
    glm::dvec3 low, high;
    glm::dvec3 size() const { return high - low; }
    double extent() const { return std::max({size().x, size().y, size().z}); }
};

// Around points, or around those that `at` finds in items; there is at least one.
template <class Items, class At = std::identity>
Box box_around(const Items& items, At at = {}) {
    Box box{std::invoke(at, items[0]), std::invoke(at, items[0])};
    for (const auto& item : items) {
        const glm::dvec3 p = std::invoke(at, item);
        box.low = glm::min(box.low, p), box.high = glm::max(box.high, p);
    }
    return box;
}

struct CodedIndex {
    std::uint64_t code;
    Index index;
};

inline constexpr int morton_bits = 21; // an axis; three axes fill 63 bits
inline constexpr double morton_cells = 1 << morton_bits;

// Cuts a cube into 2^21 cells an axis and numbers them along a Z-curve: x is the lowest bit of three.
class MortonGrid {
public:
    // `extent`: the cube's side; with 0 every point has code 0.
    MortonGrid(glm::dvec3 low, double extent) : low_(low), extent_(extent) {}
    explicit MortonGrid(const Box& box) : MortonGrid(box.low, box.extent()) {}

    std::uint64_t code(glm::dvec3 p) const {
        return spread(p.x - low_.x) | spread(p.y - low_.y) << 1 | spread(p.z - low_.z) << 2;
    }

private:
    std::uint64_t spread(double offset) const {
        // Divides instead of multiplying by the inverse, which overflows for extents below 1e-308.
        const double cell = extent_ > 0 ? offset / extent_ * morton_cells : 0;
        auto bits = cell >= morton_cells ? (std::uint64_t{1} << morton_bits) - 1
                    : cell > 0           ? static_cast<std::uint64_t>(cell)
                                         : 0;
        bits = (bits | bits << 32) & 0x1f00000000ffffull;
        bits = (bits | bits << 16) & 0x1f0000ff0000ffull;
        bits = (bits | bits << 8) & 0x100f00f00f00f00full;
        bits = (bits | bits << 4) & 0x10c30c30c30c30c3ull;
        return (bits | bits << 2) & 0x1249249249249249ull;
    }

    glm::dvec3 low_;
    double extent_;
};

// Sorts by code; equal codes keep their order. `scratch` is as long as `items`. Cost: linear, a pass for every byte in
// which codes differ.
void sort_by_code(std::span<CodedIndex> items, std::span<CodedIndex> scratch);

} // namespace unseen::vdtree
