// Shares and directions in few bits, as a vertex tree stores them. Both convert to floats where they are used.
#pragma once

#include <compare>
#include <cstdint>

#include <glm/vec3.hpp>

namespace unseen::vdtree {

// A number from 0 to 1 in 16 bits: value / 65535. In luminance that is a twentieth of the least step of an 8-bit sRGB
// display, so drawing and judging from it are exact for what is stored.
struct Unorm16 {
    static constexpr int largest = 65535;
    std::uint16_t value = 0;

    // Rounds to the nearest; what is below 0, above 1 or no number becomes 0, 1 and 0.
    static constexpr Unorm16 nearest(double x) noexcept {
        if (!(x > 0)) return {0};
        if (x >= 1) return {largest};
        return {static_cast<std::uint16_t>(x * largest + 0.5)};
    }
    constexpr operator float() const noexcept { return value * (1.0f / largest); } // ascends with value, ends at 1
    friend constexpr auto operator<=>(Unorm16, Unorm16) = default;
};
static_assert(static_cast<float>(Unorm16{Unorm16::largest}) == 1.0f);

// A unit vector or zero in 4 bytes: octahedral coordinates in 1/32767 (Meyer, Suessmuth, Sussner, Stamminger and
// Greiner 2010; Cigolle and others 2014). At most 6.5e-5 from the vector that was packed; the six axes are exact.
struct PackedNormal {
    static constexpr std::int16_t largest = 32767;
    static constexpr std::int16_t none = -32768; // x and y of the zero vector

    std::int16_t x = none, y = none;

    // Of any length; zero and what is not finite become zero.
    static PackedNormal nearest(glm::vec3 direction) noexcept;
    operator glm::vec3() const noexcept;
    bool operator==(const PackedNormal&) const = default;
};

} // namespace unseen::vdtree
