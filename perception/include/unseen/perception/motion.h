// Motion: how fast things move on the retina, and what that does to contrast sensitivity.
#pragma once

#include <glm/vec3.hpp>

#include <unseen/perception/units.h>

namespace unseen::perception {

// ---- sensitivity to moving gratings --------------------------------------------------------------------------------

// S(rho, v) = gain k v (2 pi spatial rho)^2 exp(-4 pi spatial rho / rho_max), k = 6.1 + 7.3 |log10(speed v / 3)|^3,
// rho_max = 45.9 / (speed v + 2) cpd. Kelly 1979 measured it with the image held still on the retina; Daly 1998 and
// Laird et al. 2006 fitted it to natural viewing.
struct Spatiovelocity {
    double gain, spatial, speed;
};
inline constexpr Spatiovelocity kelly_1979{1, 1, 1};
inline constexpr Spatiovelocity daly_1998{1.14 * 1.7, 0.67, 1.7};
inline constexpr Spatiovelocity laird_2006{0.6329 * 0.8404 * 0.7986, 0.8404, 0.7986}; // the default everywhere

// The eye is never at rest: slower motion counts as this.
constexpr DegreesPerSecond least_velocity{0.1};

// The fastest that tables know (CsfTable::moving()), as fast as an eye follows anything: beyond, gratings are seen best that
// are coarser than the coarsest in a table, 1/16 cpd.
inline constexpr DegreesPerSecond fastest_velocity{80};

// Of a grating that drifts over the retina at `velocity`. Luminance, size and eccentricity are no part of it.
// NaN where the frequency is not above 0 or the velocity below 0.
double spatiovelocity_sensitivity(CyclesPerDegree frequency, DegreesPerSecond velocity,
                                  const Spatiovelocity& constants = laird_2006);
// S(frequency, velocity) / S(frequency, 0): what multiplies a model that knows no motion. 1 up to least_velocity; below
// it for fine gratings, above it for coarse ones. Taken as one expression, so it holds where both would underflow.
double velocity_factor(CyclesPerDegree frequency, DegreesPerSecond velocity,
                       const Spatiovelocity& constants = laird_2006);

// ---- from motion in the world to motion on the retina --------------------------------------------------------------

// Rotations are axes times speeds in degrees per second, right-handed.

// How the direction from the eye to a point turns, as the head sees it. `eye_to_point` and `velocity` (the point's less
// the eye's, per second) are in one unit of length; `head_rotation` is that of the camera. NaN where the point is at
// the eye.
glm::dvec3 sight_rotation(const glm::dvec3& eye_to_point, const glm::dvec3& velocity,
                          const glm::dvec3& head_rotation = glm::dvec3(0));

// How fast an eye goes that follows a target (Daly 1998): min(0.82 v + 0.15, 80) degrees per second.
DegreesPerSecond pursuit_velocity(DegreesPerSecond target);
// The eye's rotation when it follows a target with this sight_rotation(). At rest for a target at rest.
glm::dvec3 pursuit_rotation(const glm::dvec3& target);

// What remains on the retina: |v_image - v_eye|, of a point in `direction` from the eye.
DegreesPerSecond retinal_velocity(const glm::dvec3& direction, const glm::dvec3& sight, const glm::dvec3& eye);
// The same for the target itself: |v - pursuit_velocity(v)|.
DegreesPerSecond retinal_velocity_of_target(DegreesPerSecond image);

} // namespace unseen::perception
