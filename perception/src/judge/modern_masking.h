// Contrast masking: what is seen less of, where there is much of its kind.
#pragma once

#include "judge/fast_math.h"

namespace unseen::perception {

inline constexpr double masking_slope = 0.7;                       // s: for noise that one knows
inline constexpr double masking_knee = 4;                          // b
inline constexpr float least_masker = 1e-20f, most_masker = 1e10f; // of fast_daly_elevation()

// By how much a masker of this contrast, in thresholds of its own, raises the threshold of what lies over it in the
// same band. Daly 1993: (1 + (k1 (k2 m)^s)^b)^(1/b), b = 4; k1 = 6^(-7/3), k2 = 6^(10/3).
inline double daly_elevation(double masker) {
    constexpr double k1 = 0.015286700226364008, k2 = 392.4980480517423;
    constexpr double asymptotic = 1e3; // from here on 1 + t^4 is t^4 in double, and t^4 could overflow
    const double t = k1 * std::pow(k2 * masker, masking_slope);
    return t > asymptotic ? t : std::sqrt(std::sqrt(1 + t * t * t * t));
}

// The same, for loops over samples, within 1e-5. With this s, k1 k2^s is 1. Maskers above `most_masker` count as that.
inline float fast_daly_elevation(float masker) {
    constexpr float power = static_cast<float>(masking_knee) * static_cast<float>(masking_slope);
    return std::sqrt(
        std::sqrt(1 + fast_exp2(power * fast_log2(std::min(std::max(masker, least_masker), most_masker)))));
}

} // namespace unseen::perception
