// How what bands of spatial frequency see of a pattern adds up.
#pragma once

#include <algorithm>
#include <cmath>

namespace unseen::perception {

// Channels that detect independently of each other, each with the probability 1 - 2^-(x^n), detect together as one of
// the n-th root of the sum of n-th powers (Quick 1974). So n is the slope of psychometric functions: 3.5 for contrast
// (Watson and Pelli 1983), with which thresholds fall as gratings grow (Robson and Graham 1981). Not fitted, nor can it
// be by the judge, which pools alike.
inline constexpr double pooling = 3.5;
// What a band adds to the sum by what it sees, in thresholds.
inline double to_power_of_pooling(double seen) { return seen * seen * seen * std::sqrt(seen); }

// What a band sees of a patch, as a share of its contrast, by the patch's width in the band's waves. Derived: the share
// of the band's own patch that it covers.
template <class T>
T share_of_area(T waves) {
    return std::min(T(1), waves * waves);
}
// Likewise of up to so many patches side by side whose signs differ at random: 1 / n of the contrast for n times the
// width.
template <class T>
T share_of_patches(T waves, int most_side_by_side) {
    T most = 0;
    for (int side = 1; side <= most_side_by_side; side *= 2) {
        const T filled = static_cast<T>(side) * waves;
        most = std::max(most, share_of_area(filled) / static_cast<T>(side));
        if (filled >= 1) break; // more only lose contrast
    }
    return most;
}

} // namespace unseen::perception
