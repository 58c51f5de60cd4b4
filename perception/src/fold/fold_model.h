// The numbers of the test by errors: what is made of a measurement when a criterion is made. Files hold none of them.
//
// Each constant says where it comes from. "Paper" and "derived" mean what they say. "By trial" means: chosen by
// comparing pictures of whole views, so that a judge of <perception/judge.h> saw no difference; not fitted, and no
// script finds the number again. Which meshes were used was not recorded; those in the tables of docs/evidence.md
// (bunny, horse, armadillo, gargoyle) may have been among them: these tables are no independent evidence.
#pragma once

#include <algorithm>
#include <cmath>

namespace unseen::perception {

// Exponent of probability summation over bands (Quick 1974). Paper: the slope of psychometric functions, 3.5 (Watson
// and Pelli 1983).
inline constexpr double pooling = 3.5;
// What a band adds to the sum by what it sees, in thresholds.
inline double to_power_of_pooling(double seen) { return seen * seen * seen * std::sqrt(seen); }

// A mean over some cells of a picture is less than the largest shift of an outline that curves. By trial; checkerboards
// and long rings.
inline constexpr float peak_of_shift = 1.2f;
// An outline moves with the folds beside it, too: times the largest distance of a point. By trial.
inline constexpr float moved_by_neighbours = 1.4f;

// The amplitude of a grating, by the mean difference of points. A sine's is pi / 2 = 1.6 times its mean; more, for
// neighbours err alike. By trial.
inline constexpr float amplitude_of_point_mean = 1.9f;
// By the mean distance that shifts what a ring shows. Derived: pi / 2, rounded up.
inline constexpr double amplitude_of_shift_mean = 1.6;

// Rings of a larger radius, in widths of what changes, reach beyond their pictures, whose half side is 1.5 or 2.1
// widths: points count, too. By trial; long triangles.
inline constexpr float longest_ring = 4;

// Parts of the surface that are nearer to each other than so many times the distance by which folds move them may pass
// through each other. By trial.
inline constexpr float contact_reach = 6;
// Sine of the angle at which parts meet: the line where one hides the other moves by 1 / sine; flatter ones count as
// this. By trial.
inline constexpr float least_sine = 0.1f;

// Patches side by side whose signs differ at random: 1 / n of the contrast for n times the width, up to this n. What
// more of them come to, the bias tells. By trial.
inline constexpr int most_side_by_side = 4;

// What a band sees of a patch, as a share of its contrast, by the patch's width in the band's waves. Derived: the share
// of the band's own patch that it covers.
template <class T>
T share_of_area(T waves) {
    return std::min(T(1), waves * waves);
}
// Likewise of patches side by side.
template <class T>
T share_of_patches(T waves) {
    T most = 0;
    for (int side = 1; side <= most_side_by_side; side *= 2)
        most = std::max(most, share_of_area(static_cast<T>(side) * waves) / static_cast<T>(side));
    return most;
}

// Octaves of contrast that a small part of a patch may have over all of it: sharper ones count as this, a sixteenth of
// the width. By trial: sharper ones are rare, and each octave is more rows.
inline constexpr int steepest_spike_octaves = 8;

// Pixels. A picture of 64 samples a pixel tells no finer shifts of an outline than about this, two thirds of the step
// of one sample, 1/64. Derived from how the pictures of the trials were made; the two thirds by trial. Where pixels are
// so coarse that half of what can be seen is less, it would take more samples, not more triangles.
inline constexpr double sampled_shift_px = 0.011;

// Of a stage's contrasts: the worst direction may lie between those of the pictures. By trial.
inline constexpr double between_directions = 1.15;

} // namespace unseen::perception
