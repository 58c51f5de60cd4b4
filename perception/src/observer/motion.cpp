// Kelly's spatiovelocity surface and Daly's model of smooth pursuit.
//
// D. H. Kelly, "Motion and vision. II. Stabilized spatio-temporal threshold surface", JOSA 69(10), 1979.
// S. Daly, "Engineering observations from spatiovelocity and spatiotemporal visual models", SPIE 3299, 1998.
// J. Laird, M. Rosen, J. Pelz, E. Montag, S. Daly, "Spatio-velocity CSF as a function of retinal velocity using
// unstabilized stimuli", SPIE 6057, 2006.
#include <unseen/perception/motion.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <glm/geometric.hpp>

namespace unseen::perception {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
// Daly 1998: the share of a target's speed that the eye keeps up with, its drift, and its greatest speed in pursuit.
constexpr double pursuit_gain = 0.82;
constexpr double drift_deg_s = 0.15, greatest_pursuit_deg_s = 80;

bool in_domain(double cpd, double deg_s) { return cpd > 0 && std::isfinite(cpd) && deg_s >= 0 && std::isfinite(deg_s); }

// log k(v).
double log_gain(double deg_s, const Spatiovelocity& c) {
    const double decades = std::abs(std::log10(c.speed * deg_s / 3));
    return std::log(6.1 + 7.3 * decades * decades * decades);
}

double clamped(DegreesPerSecond velocity) { return std::max(velocity.value(), least_velocity.value()); }

} // namespace

double spatiovelocity_sensitivity(CyclesPerDegree frequency, DegreesPerSecond velocity, const Spatiovelocity& c) {
    if (!in_domain(frequency.value(), velocity.value())) return nan;
    const double deg_s = clamped(velocity), highest_cpd = 45.9 / (c.speed * deg_s + 2);
    const double wave = 2 * std::numbers::pi * c.spatial * frequency.value();
    return c.gain * std::exp(log_gain(deg_s, c) + std::log(deg_s) + 2 * std::log(wave) - 2 * wave / highest_cpd);
}

double velocity_factor(CyclesPerDegree frequency, DegreesPerSecond velocity, const Spatiovelocity& c) {
    if (!in_domain(frequency.value(), velocity.value())) return nan;
    const double deg_s = clamped(velocity), least = least_velocity.value();
    if (deg_s == least) return 1;
    const double wave = 2 * std::numbers::pi * c.spatial * frequency.value();
    const double rise = log_gain(deg_s, c) - log_gain(least, c) + std::log(deg_s / least);
    return std::exp(rise - 2 * wave * c.speed * (deg_s - least) / 45.9);
}

glm::dvec3 sight_rotation(const glm::dvec3& eye_to_point, const glm::dvec3& velocity, const glm::dvec3& head_rotation) {
    const double distance = std::hypot(eye_to_point.x, eye_to_point.y, eye_to_point.z); // its square may overflow
    if (!(distance > 0)) return glm::dvec3(nan);
    return degrees_per_radian * glm::cross(eye_to_point / distance, velocity / distance) - head_rotation;
}

DegreesPerSecond pursuit_velocity(DegreesPerSecond target) {
    return DegreesPerSecond(std::min(pursuit_gain * target.value() + drift_deg_s, greatest_pursuit_deg_s));
}

glm::dvec3 pursuit_rotation(const glm::dvec3& target) {
    const double speed = glm::length(target);
    if (speed == 0) return glm::dvec3(0);
    return target * (pursuit_velocity(DegreesPerSecond(speed)).value() / speed);
}

DegreesPerSecond retinal_velocity(const glm::dvec3& direction, const glm::dvec3& sight, const glm::dvec3& eye) {
    return DegreesPerSecond(glm::length(glm::cross(sight - eye, glm::normalize(direction))));
}

DegreesPerSecond retinal_velocity_of_target(DegreesPerSecond image) {
    return DegreesPerSecond(std::abs(image.value() - pursuit_velocity(image).value()));
}

} // namespace unseen::perception
