// Numbers for property tests: ordinary ones, and with some likelihood those that formulas stumble over.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include <rapidcheck.h>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace unseen::support {

inline rc::Gen<double> between(double low, double high) {
    constexpr std::uint32_t steps = 1u << 30;
    return rc::gen::map(rc::gen::resize(rc::kNominalSize, rc::gen::inRange<std::uint32_t>(0, steps + 1)),
                        [=](std::uint32_t i) { return low + (high - low) * (static_cast<double>(i) / steps); });
}

// Of either sign, 0 included, of any magnitude from 10^least to 10^most.
inline rc::Gen<double> any_number(double least, double most) {
    return rc::gen::apply(
        [](double exponent, double kind) {
            if (kind < 0.05) return 0.0;
            if (kind < 0.15) return kind < 0.1 ? 1.0 : -1.0;
            const double magnitude = std::pow(10.0, exponent);
            return kind < 0.6 ? magnitude : -magnitude;
        },
        between(least, most), between(0, 1));
}

inline rc::Gen<glm::dvec3> any_point(double least, double most) {
    return rc::gen::apply([](double x, double y, double z) { return glm::dvec3(x, y, z); }, any_number(least, most),
                          any_number(least, most), any_number(least, most));
}

// Along axes, edges and corners of the cube, too.
inline rc::Gen<glm::dvec3> any_direction() {
    return rc::gen::map(any_point(-8, 0),
                        [](glm::dvec3 v) { return glm::dot(v, v) > 0 ? glm::normalize(v) : glm::dvec3(0, 0, 1); });
}

} // namespace unseen::support
