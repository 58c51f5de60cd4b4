// How a spot fades towards its edge.
#pragma once

#include <algorithm>

#include <unseen/vdtree/lighting.h>

namespace unseen::vdtree {

// The share of the light within the inner angle, by the cosine of the angle from the axis. Precondition: a valid spot
// whose inner angle is less than the outer one.
inline double spot_share(const LightSource& spot, double cosine) {
    const double t = std::clamp((cosine - spot.outer_cosine) / (spot.inner_cosine - spot.outer_cosine), 0.0, 1.0);
    return t * t * (3 - 2 * t);
}

} // namespace unseen::vdtree
