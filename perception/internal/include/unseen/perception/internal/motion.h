// Motion on the retina, and what it does to contrast sensitivity.
#pragma once

#include <unseen/perception/units.h>

namespace unseen::perception {

// The eye is never at rest: slower motion counts as this.
constexpr DegreesPerSecond least_velocity{0.1};

// The fastest motion that tables know (CsfTable::moving()), as fast as an eye can follow. Gratings that move faster are
// seen best if they are coarser than the coarsest in a table, 1/16 cpd.
inline constexpr DegreesPerSecond fastest_velocity{80};

// S(frequency, velocity) / S(frequency, 0) of a grating that drifts over the retina, by
//
//   S(rho, v) = k v (2 pi c0 rho)^2 exp(-4 pi c0 rho / rho_max),   k = 6.1 + 7.3 |log10(c1 v / 3)|^3,
//   rho_max = 45.9 / (c1 v + 2) cpd,   c0 = 0.8404, c1 = 0.7986.
//
// Kelly 1979 measured it with the image held still on the retina; Daly 1998 and Laird et al. 2006 fitted it to natural
// viewing. It multiplies a model that knows no motion: 1 up to least_velocity, below 1 for fine gratings, above it for
// coarse ones. NaN if the frequency is not above 0, or the velocity below 0.
double velocity_factor(CyclesPerDegree frequency, DegreesPerSecond velocity);

} // namespace unseen::perception
