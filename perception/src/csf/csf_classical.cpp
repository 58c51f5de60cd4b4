// The older closed forms: Mannos and Sakrison, Rushmeier, Daly, and Barten's three.
//
// J. Mannos, D. Sakrison, "The effects of a visual fidelity criterion on the encoding of images", IEEE Transactions on
// Information Theory 20(4), 1974.
// P. Barten, "The square root integral (SQRI): a new metric to describe the effect of various display parameters on
// perceived image quality", SPIE 1077, 1989.
// S. Daly, "The Visible Differences Predictor", in Digital Images and Human Vision, MIT Press 1993.
// H. Rushmeier, G. Ward, C. Piatko, P. Sanders, B. Rust, "Comparing real and synthetic images: some ideas about
// metrics", Rendering Techniques 1995.
// P. Barten, "Contrast Sensitivity of the Human Eye and its Effects on Image Quality", SPIE Press 1999.
// P. Barten, "Formula for the contrast sensitivity of the human eye", SPIE 5294, 2003.
#include <algorithm>
#include <cmath>
#include <limits>

#include "csf/csf_model.h"

namespace unseen::perception {
namespace {

// exp(-x) sqrt(1 + 0.06 exp(x)), common to Daly, Rushmeier and Barten 1989. Written like that it is 0 times infinity
// for large x.
double damping(double x) { return std::exp(-x / 2) * std::sqrt(std::exp(-x) + 0.06); }

// ---- relative models ------------------------------------------------------------------------------------------------

// The greatest values of the two published curves: at 7.8909 and at 3.6046 cpd.
constexpr double mannos_sakrison_peak = 0.98087787655726166, rushmeier_peak = 1.8830747958791485;

double mannos_sakrison(double cpd) {
    const double x = 0.114 * cpd;
    return 2.6 * (0.0192 + x) * std::exp(-std::pow(x, 1.1));
}

double rushmeier(double cpd) { return std::pow(0.008 / (cpd * cpd * cpd) + 1, -0.2) * 1.42 * cpd * damping(0.3 * cpd); }

// ---- Daly -----------------------------------------------------------------------------------------------------------

constexpr double daly_peak = 250;          // P
constexpr double daly_epsilon = 0.9;       // scale of frequency and amplitude
constexpr double daly_eccentricity = 0.24; // k, per degree
static_assert(relative_models_peak == daly_peak);

// ((3.23 (rho^2 A)^-0.3)^5 + 1)^-0.2, by logarithms: rho^2 A under- and overflows long before rho and A do.
double daly_area(double cpd, double area_deg2) {
    const double y = 5 * (std::log(3.23) - 0.3 * (2 * std::log(cpd) + std::log(area_deg2)));
    const double log_of_sum = y > 0 ? y + std::log1p(std::exp(-y)) : std::log1p(std::exp(y));
    return std::exp(-0.2 * log_of_sum);
}

double daly_branch(double cpd, double cdm2, double area_deg2) {
    const double amplitude = 0.801 * std::pow(1 + 0.7 / cdm2, -0.2), width = 0.3 * std::pow(1 + 100 / cdm2, 0.15);
    const double scaled = daly_epsilon * cpd;
    return daly_peak * daly_area(cpd, area_deg2) * amplitude * scaled * damping(width * scaled);
}

// ---- Barten ---------------------------------------------------------------------------------------------------------

// 1 - exp(-x), which would be 0 for small x if written like that.
double rising(double x) { return -std::expm1(-x); }

// `area_deg2` is that of a square field, X0^2, in all of Barten's forms.
double barten_2004(double cpd, double cdm2, double area_deg2) {
    const double square = cpd * cpd;
    const double optics = std::exp(-0.0016 * square * std::pow(1 + 100 / cdm2, 0.08));
    const double integration = 1 + 144 / area_deg2 + 0.64 * square;
    const double noise = 63 / std::pow(cdm2, 0.83) + 1 / rising(0.02 * square);
    return 5200 * optics / std::sqrt(integration * noise);
}

// Le Grand's formula for the pupil's diameter in mm, with the field's size as Barten has it.
double pupil_mm(double cdm2, double area_deg2) { return 5 - 3 * std::tanh(0.4 * std::log10(cdm2 * area_deg2 / 1600)); }

// In trolands, with the Stiles-Crawford effect.
double retinal_illuminance(double pupil, double cdm2) {
    const double rim = pupil / 9.7, far_rim = pupil / 12.4;
    return std::numbers::pi * pupil * pupil / 4 * cdm2 * (1 - rim * rim + std::pow(far_rim, 4));
}

constexpr double barten_greatest_field = 12; // Xmax, degrees

} // namespace

SquareDegrees barten_summation_area(const BartenConstants& constants, CyclesPerDegree frequency) {
    const double cycles = frequency.value() / constants.greatest_cycles;
    return SquareDegrees(1 / (1 / (barten_greatest_field * barten_greatest_field) + cycles * cycles));
}

double barten_sensitivity(const BartenConstants& constants, CyclesPerDegree frequency, Luminance luminance,
                          SquareDegrees area, SquareDegrees field) {
    constexpr double integration_time = 0.1;     // T, s
    constexpr double quantum_efficiency = 0.03;  // eta
    constexpr double photons = 1.2274e6;         // p, per s, deg2 and troland
    constexpr double neural_noise = 3e-8;        // Phi0, s deg2
    constexpr double aberration_deg = 0.08 / 60; // Cab, per mm of the pupil

    const double pupil = pupil_mm(luminance.value(), field.value());
    const double sigma_deg = std::hypot(constants.line_spread.value(), aberration_deg * pupil);
    const double blur = std::numbers::pi * sigma_deg * frequency.value();
    const double optics = std::exp(-2 * blur * blur);
    const double inhibited = frequency / constants.inhibition;
    const double integration = 1 / area.value() + 1 / barten_summation_area(constants, frequency).value();
    const double photon_noise = 1 / (quantum_efficiency * photons * retinal_illuminance(pupil, luminance.value()));
    const double noise = photon_noise + neural_noise / rising(inhibited * inhibited);
    return optics / constants.signal_to_noise / std::sqrt(2 / integration_time * integration * noise);
}

Barten1989::Barten1989(double cdm2)
    : amplitude_(440 * std::pow(1 + 0.7 / cdm2, -0.2)), width_(0.3 * std::pow(1 + 100 / cdm2, 0.15)) {}
double Barten1989::operator()(double cpd) const { return amplitude_ * cpd * damping(width_ * cpd); }

double daly_ceiling(const Stimulus& s) { return daly_branch(s.frequency.value(), s.luminance.value(), s.area.value()); }

double daly_eccentric(const Stimulus& s) {
    const double accommodation = 0.856 * std::pow(s.distance.value(), 0.14);
    const double scale = 1 / (1 + daly_eccentricity * s.eccentricity.value());
    // Horizontal and vertical gratings, which are seen best: Daly's factor for orientation is 1.
    return daly_branch(s.frequency.value() / (accommodation * scale), s.luminance.value(), s.area.value());
}

bool is_relative(CsfModel model) { return model == CsfModel::mannos_sakrison || model == CsfModel::rushmeier; }

double classical_at_fovea(CsfModel model, const Stimulus& s) {
    const double cpd = s.frequency.value(), cdm2 = s.luminance.value(), area_deg2 = s.area.value();
    switch (model) {
    case CsfModel::barten_1989: return Barten1989(cdm2)(cpd);
    case CsfModel::barten_1999: return barten_sensitivity({}, s.frequency, s.luminance, s.area, s.area);
    case CsfModel::barten_fitted:
        return barten_sensitivity(fitted_barten, s.frequency, s.luminance, s.area, barten_fitted_field);
    case CsfModel::barten_2004: return barten_2004(cpd, cdm2, area_deg2);
    case CsfModel::mannos_sakrison: return mannos_sakrison(cpd) * (relative_models_peak / mannos_sakrison_peak);
    case CsfModel::rushmeier: return rushmeier(cpd) * (relative_models_peak / rushmeier_peak);
    default: return std::numeric_limits<double>::quiet_NaN();
    }
}

} // namespace unseen::perception
