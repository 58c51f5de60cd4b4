// Quantities with units: explicit in, value() out, only meaningful arithmetic. Inside a formula, unwrap once at the top
// and name the unit (`freq_cpd`).
#pragma once

#include <compare>
#include <numbers>

namespace unseen::perception {

template <class Unit>
class Quantity {
public:
    constexpr Quantity() = default;
    constexpr explicit Quantity(double value) : value_(value) {}
    constexpr double value() const { return value_; }

    constexpr Quantity operator+(Quantity o) const { return Quantity(value_ + o.value_); }
    constexpr Quantity operator-(Quantity o) const { return Quantity(value_ - o.value_); }
    constexpr Quantity operator-() const { return Quantity(-value_); }
    constexpr Quantity operator*(double s) const { return Quantity(value_ * s); }
    constexpr Quantity operator/(double s) const { return Quantity(value_ / s); }
    constexpr double operator/(Quantity o) const { return value_ / o.value_; }
    constexpr auto operator<=>(const Quantity&) const = default;

private:
    double value_ = 0;
};
template <class Unit>
constexpr Quantity<Unit> operator*(double s, Quantity<Unit> q) {
    return q * s;
}

using Degrees = Quantity<struct DegreesUnit>;
using Radians = Quantity<struct RadiansUnit>;
using SquareDegrees = Quantity<struct SquareDegreesUnit>;
using Metres = Quantity<struct MetresUnit>;
using Hertz = Quantity<struct HertzUnit>;
using DegreesPerSecond = Quantity<struct DegreesPerSecondUnit>;
using Lux = Quantity<struct LuxUnit>;
using Luminance = Quantity<struct CandelaPerSquareMetreUnit>;
using CyclesPerDegree = Quantity<struct CyclesPerDegreeUnit>;
using PixelsPerDegree = Quantity<struct PixelsPerDegreeUnit>;

inline constexpr double degrees_per_radian = 180 / std::numbers::pi;
constexpr Radians to_radians(Degrees a) { return Radians(a.value() * (std::numbers::pi / 180)); }
constexpr Degrees to_degrees(Radians a) { return Degrees(a.value() * degrees_per_radian); }
constexpr CyclesPerDegree nyquist(PixelsPerDegree p) { return CyclesPerDegree(p.value() / 2); }

} // namespace unseen::perception
