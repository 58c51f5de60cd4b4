// Functions of float that loops over samples run as vectors, since they neither branch nor set errno. Each is within
// 4e-7 of its result, or of 1 where the result is a logarithm or an angle.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace unseen::perception {

// Precondition: a normal, positive number.
inline float fast_log2(float x) {
    constexpr std::uint32_t half_root = 0x3f3504f3; // 1 / sqrt 2: mantissas are taken from there to sqrt 2
    const auto bits = std::bit_cast<std::uint32_t>(x);
    const auto exponent = static_cast<std::int32_t>(bits - half_root) >> 23;
    const float m = std::bit_cast<float>(bits - (static_cast<std::uint32_t>(exponent) << 23));
    const float t = (m - 1) / (m + 1), square = t * t; // ln m = 2 artanh t
    constexpr auto scale = static_cast<float>(2 / std::numbers::ln2);
    const float series = 1 + square * (1.f / 3 + square * (1.f / 5 + square * (1.f / 7)));
    return static_cast<float>(exponent) + scale * t * series;
}

// Below 2^-126 and above 2^127 it is these.
inline float fast_exp2(float x) {
    constexpr float rounder = 12582912; // 1.5 2^23: what is added to it loses its fraction
    const float limited = std::min(std::max(x, -126.f), 127.f), whole = (limited + rounder) - rounder;
    constexpr auto ln2 = static_cast<float>(std::numbers::ln2);
    const float y = (limited - whole) * ln2; // at most 0.35
    const float series =
        1 + y * (1 + y * (1.f / 2 + y * (1.f / 6 + y * (1.f / 24 + y * (1.f / 120 + y * (1.f / 720))))));
    return series * std::bit_cast<float>((static_cast<std::uint32_t>(static_cast<std::int32_t>(whole) + 127)) << 23);
}

// The angle of (x, y) from the x axis, in radians from 0 to pi; y >= 0, and not both 0.
inline float fast_angle(float y, float x) {
    constexpr auto pi = static_cast<float>(std::numbers::pi);
    const float wide = std::abs(x), t = std::min(wide, y) / std::max(wide, y), square = t * t;
    // Hastings' polynomial for the arc tangent of 0 to 1 with one more term; minimax.
    const float series =
        t * (0.99999934f +
             square * (-0.33329856f +
                       square * (0.19946536f +
                                 square * (-0.13908534f +
                                           square * (0.09642004f +
                                                     square * (-0.05590986f +
                                                               square * (0.02186123f + square * -0.0040540580f)))))));
    const float steep = y > wide ? pi / 2 - series : series;
    return x < 0 ? pi - steep : steep;
}

} // namespace unseen::perception
