// Directions along the axes of NormalSlabs.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

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
