// Linear colour: luminance by Rec. 709's primaries, and the transfer function of sRGB.
#pragma once

#include <cmath>

#include <glm/vec3.hpp>

namespace unseen {

// ITU-R BT.709: the share of each linear primary in the luminance of white. They add up to 1.
inline constexpr glm::dvec3 rec709_weights(0.2126, 0.7152, 0.0722);

// Relative luminance of linear RGB, in the colour's own precision.
template <class T>
constexpr T rec709_luminance(const glm::vec<3, T>& rgb) {
    return static_cast<T>(0.2126) * rgb.r + static_cast<T>(0.7152) * rgb.g + static_cast<T>(0.0722) * rgb.b;
}

// IEC 61966-2-1, one channel, 0..1 both ways. The limits, 0.04045 and 0.0031308, are each other's image to the
// standard's own rounding. Values below 0 continue the straight line, and NaN stays NaN.
template <class T>
T srgb_to_linear(T encoded) {
    if (!(encoded > static_cast<T>(0.04045))) return encoded / static_cast<T>(12.92);
    return std::pow((encoded + static_cast<T>(0.055)) / static_cast<T>(1.055), static_cast<T>(2.4));
}
template <class T>
T linear_to_srgb(T linear) {
    if (!(linear > static_cast<T>(0.0031308))) return linear * static_cast<T>(12.92);
    return static_cast<T>(1.055) * std::pow(linear, static_cast<T>(1) / static_cast<T>(2.4)) - static_cast<T>(0.055);
}

} // namespace unseen
