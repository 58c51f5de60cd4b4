// The spatiovelocity surface as Laird et al. fitted it, and Daly's model of smooth pursuit.
//
// D. H. Kelly, "Motion and vision. II. Stabilized spatio-temporal threshold surface", JOSA 69(10), 1979.
// S. Daly, "Engineering observations from spatiovelocity and spatiotemporal visual models", SPIE 3299, 1998.
// J. Laird, M. Rosen, J. Pelz, E. Montag, S. Daly, "Spatio-velocity CSF as a function of retinal velocity using
// unstabilized stimuli", SPIE 6057, 2006.
#include <unseen/perception/internal/motion.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace unseen::perception {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
// Daly 1998: the share of a target's speed that the eye keeps up with, its drift, and its greatest speed in pursuit.
constexpr double pursuit_gain = 0.82;
constexpr double drift_deg_s = 0.15, greatest_pursuit_deg_s = 80;

bool in_domain(double cpd, double deg_s) { return cpd > 0 && std::isfinite(cpd) && deg_s >= 0 && std::isfinite(deg_s); }

// Laird et al. 2006.
constexpr double spatial = 0.8404, speed = 0.7986;

// log k(v).
double log_gain(double deg_s) {
    const double decades = std::abs(std::log10(speed * deg_s / 3));
    return std::log(6.1 + 7.3 * decades * decades * decades);
}

double clamped(DegreesPerSecond velocity) { return std::max(velocity.value(), least_velocity.value()); }

} // namespace

double velocity_factor(CyclesPerDegree frequency, DegreesPerSecond velocity) {
    if (!in_domain(frequency.value(), velocity.value())) return nan;
    const double deg_s = clamped(velocity), least = least_velocity.value();
    if (deg_s == least) return 1; // one expression below, which holds where S underflows
    const double wave = 2 * std::numbers::pi * spatial * frequency.value();
    const double rise = log_gain(deg_s) - log_gain(least) + std::log(deg_s / least);
    return std::exp(rise - 2 * wave * speed * (deg_s - least) / 45.9);
}

DegreesPerSecond pursuit_velocity(DegreesPerSecond target) {
    return DegreesPerSecond(std::min(pursuit_gain * target.value() + drift_deg_s, greatest_pursuit_deg_s));
}

DegreesPerSecond retinal_velocity_of_target(DegreesPerSecond image) {
    return DegreesPerSecond(std::abs(image.value() - pursuit_velocity(image).value()));
}

} // namespace unseen::perception
