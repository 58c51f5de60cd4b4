#include "change/flicker.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

namespace unseen::perception {
namespace {

// Fitted constants as published with the program (gfxdisp/elaTCSF).
constexpr double scale = 154.133, second_share = 0.721095, second_slower = 2.12547, stage_s = 0.00292069;
constexpr int first_stages = 15, second_stages = 16;
constexpr double decay_per_degree = 0.0330933; // log10
constexpr double luminance_scale = 1.76801, luminance_half = 1.62402, luminance_power = 0.533781;
constexpr double speed_at_1_cdm2 = 0.6678, speed_per_decade = 0.222269; // of time
constexpr double speed_per_degree = 0.0341811, offset_hz = 2;
constexpr double darkest_cdm2 = 0.1;

// |H| at a frequency of the foveal filter.
double amplitude(double hz) {
    const std::complex<double> z(0, 2 * std::numbers::pi * hz * stage_s);
    return std::abs(
        scale * (std::pow(1.0 + z, -first_stages) - second_share * std::pow(1.0 + second_slower * z, -second_stages)));
}

// The response of n equal low-pass stages of time constant 1 to a step: 1 - e^-x (1 + x + ... + x^(n-1) / (n-1)!).
double stages_step(int n, double x) {
    if (!(x > 0)) return 0;
    double term = 1, sum = 1;
    for (int k = 1; k < n; ++k) sum += term *= x / k;
    return 1 - std::exp(-x) * sum;
}

constexpr double table_step_s = 5e-4, table_end_s = 0.4; // when it has settled
constexpr std::size_t table_size = static_cast<std::size_t>(table_end_s / table_step_s) + 2;

struct StepTable {
    std::array<double, table_size> response{};
    double peak_s = 0;
    StepTable() {
        for (std::size_t i = 0; i < table_size; ++i) {
            const double seconds = static_cast<double>(i) * table_step_s;
            response[i] = scale * (stages_step(first_stages, seconds / stage_s) -
                                   second_share * stages_step(second_stages, seconds / (second_slower * stage_s)));
        }
        peak_s = static_cast<double>(std::ranges::max_element(response) - response.begin()) * table_step_s;
    }
};

double luminance_speed(double cdm2) {
    return speed_at_1_cdm2 + speed_per_decade * std::log10(std::max(cdm2, darkest_cdm2));
}

} // namespace

double flicker_speed(double eccentricity_deg, double cdm2) {
    return luminance_speed(cdm2) * (1 + speed_per_degree * eccentricity_deg);
}

double flicker_scale(double eccentricity_deg, double cdm2) {
    return std::pow(10.0, -decay_per_degree * eccentricity_deg) * luminance_scale *
           std::pow(1 + luminance_half / std::max(cdm2, darkest_cdm2), -luminance_power);
}

double flicker_sensitivity(double hz, double eccentricity_deg, double cdm2) {
    const double foveal_hz =
        ((hz + offset_hz) / (1 + speed_per_degree * eccentricity_deg) - offset_hz) / luminance_speed(cdm2);
    return flicker_scale(eccentricity_deg, cdm2) * amplitude(foveal_hz);
}

double step_response(double seconds_after_peak) {
    static const StepTable table;
    const double seconds = seconds_after_peak + table.peak_s;
    if (!(seconds > 0)) return 0;
    if (!(seconds < table_end_s)) return scale * (1 - second_share);
    const double place = seconds / table_step_s;
    const auto i = static_cast<std::size_t>(place);
    return std::lerp(table.response[i], table.response[i + 1], place - static_cast<double>(i));
}

} // namespace unseen::perception
