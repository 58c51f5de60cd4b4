// Factors of the test by errors that are the same for every FoldModel. Each has its argument. On the tuning set of
// `unseen-bench fit` nothing was seen with any of the other values that were tried.
//
// The order in which a measurement folds nodes goes by amplitude_of_point_mean, longest_ring and most_side_by_side:
// other values of these are another measurement::revision.
#pragma once

#include <algorithm>
#include <cmath>

namespace unseen::perception::factors {

// ---- distances

// The largest shift of an outline, over the largest mean of shifts over a seventh of the fold's width. It is 1.15 for a
// ridge as wide as the fold, and 1.28 for a cone.
inline constexpr float peak_of_shift = 1.2f;
// An outline also moves with the folds beside it: by this factor of the largest distance of a point. Two independent
// shifts of one size add up to sqrt 2.
inline constexpr float moved_by_neighbours = 1.4f;
// Pixels. A picture of 64 samples a pixel shows no finer shifts of an outline than about two thirds of the step of one
// sample, 1/64. If half of what can be seen is less than this, pixels are so coarse that it would take more samples,
// not more triangles.
inline constexpr double sampled_shift_px = 0.011;

// ---- amplitudes

// The amplitude of a grating, by the mean difference of points. A sine's is pi / 2 = 1.57 times its mean; this is more,
// because neighbours err alike.
inline constexpr float amplitude_of_point_mean = 1.9f;
// The same by the mean distance that shifts what a ring shows: a sine's pi / 2, rounded up.
inline constexpr double amplitude_of_shift_mean = 1.6;
// Rings of a larger radius, in widths of what changes, reach beyond their pictures, so points count, too. The larger
// picture's half side is 2.1 widths: it shows a quarter of the square around a ring of 4.
inline constexpr float longest_ring = 4;
// Patches side by side whose signs differ at random are seen as 1 / n of the contrast at n times the width, up to this
// n: 1, 2, 4. FoldRecord::bias tells what more of them come to.
inline constexpr int most_side_by_side = 4;
// Contrasts on textured surfaces count more: textures change everywhere at once, while on other surfaces few nodes
// change as much as they can. With 1, one judge of two sees noise aside on the textured models of the tests.
inline constexpr float contrast_of_textures = 1.3f;
// Contrasts of pictures of the whole mesh count more: the worst direction may lie between those of the pictures. One of
// these 26 is within 31 degrees of any direction, and foreshortening by that angle is 1.16.
inline constexpr double between_directions = 1.15;

// ---- sensitivity needed, 1: all of the observer's

// By areas whose light shifts together: the shift is the largest from any direction, and counts as if all of the area
// shifted as its nodes do in the mean. With 0.5, one judge of two sees a sheet of regular waves as a whole, 57 degrees
// aside on a display of 1,000 cd/m2 (V 1.3; with 0.6 V 0.8).
inline constexpr double needed_by_areas = 0.6;
// By open borders: a border may be made so that all of it shifts alike, as that of many equal holes.
inline constexpr double needed_by_borders = 0.5;

} // namespace unseen::perception::factors

namespace unseen::perception {

// ---- how what bands of spatial frequency see of a pattern adds up

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
