// Kelly's spatiovelocity surface with the constants of Laird et al. 2006, as its formula is published.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

namespace unseen::support {

inline double spatiovelocity_sensitivity(double cpd, double deg_s) {
    constexpr double c0 = 0.8404, c1 = 0.7986, c2 = 0.6329;
    const double v = std::max(deg_s, 0.1), decades = std::abs(std::log10(c1 * v / 3));
    const double wave = 2 * std::numbers::pi * c0 * cpd, highest = 45.9 / (c1 * v + 2);
    return c2 * c0 * c1 * (6.1 + 7.3 * decades * decades * decades) * v * wave * wave * std::exp(-2 * wave / highest);
}

} // namespace unseen::support
