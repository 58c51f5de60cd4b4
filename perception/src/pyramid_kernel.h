// The kernel of all pyramids of frequency bands here: Burt and Adelson (1983), a = 0.4.
//
// The pyramids themselves differ where they must: the judge's mirrors a picture at its borders, in double; that of
// whole meshes (measure/pyramid.h) has nothing around it and grows outward, in float; that of one fold
// (measure/fold_picture.h) keeps the resolution of its 16 x 16 cells. The texture's (vdtree/texture.h) is of least and
// largest values and splits nothing into bands.
#pragma once

#include <cmath>

namespace unseen::perception {

inline constexpr double kernel_middle = 0.4, kernel_near = 0.25, kernel_far = 0.05; // taps, by distance in samples

// What the kernel leaves of a grating's amplitude, by radians a sample.
inline double kernel_response(double omega) {
    return kernel_middle + 2 * kernel_near * std::cos(omega) + 2 * kernel_far * std::cos(2 * omega);
}

// A level's band is the level less its next one, expanded. The first goes up to the Nyquist frequency, after which it
// is named; the second is centred on this share of that, and each further one an octave below.
inline constexpr double second_band_ratio = 0.3228;

} // namespace unseen::perception
