// Private to perception: elaTCSF in parts, for pictures. Its response over time is the difference of two cascades of
// equal low-pass stages, whose response to a step has a closed form.
#pragma once

#include <array>

namespace unseen::perception {

// Over area: sensitivities to this power are summed, and a sum of so many square degrees is the threshold.
inline constexpr double flicker_pooling = 3.80022, flicker_pooling_deg2 = 6.52801;

// The share of a grating's contrast that counts as flicker, as three Gaussians over frequency, which are blurs of a
// picture. Within 0.02 of castleCSF's transient channel P(rho) rho sqrt(Ac) over its largest value, at 0.43 cpd, and 1
// below that frequency.
struct FlickerBlur {
    double weight, cpd; // exp(-(rho / cpd)^2)
};
inline constexpr std::array flicker_blurs = {FlickerBlur{0.561601, 2.803293}, FlickerBlur{0.309379, 7.765347},
                                             FlickerBlur{0.12902, 23.132176}};

// Sensitivity is flicker_scale() times the response of the filter, whose time runs flicker_speed() times as fast as in
// the fovea at the luminance where that is 1. Luminances count as at least 0.1 cd/m2, below which nothing was measured.
double flicker_scale(double eccentricity_deg, double cdm2);
double flicker_speed(double eccentricity_deg, double cdm2);

// The sensitivity at a point to contrast that flickers at one frequency. (elaTCSF also shifts frequencies aside, by up
// to 3 Hz, for flicker alone.)
double flicker_sensitivity(double hz, double eccentricity_deg, double cdm2);

// The filter's response to a step so long (0 or more) after its largest value.
double step_response(double seconds_after_peak);

} // namespace unseen::perception
