// elaTCSF. Its response over time is the difference of two cascades of equal low-pass stages, whose response to a step
// has a closed form. How fast time runs follows from luminance and eccentricity.
#include <unseen/perception/internal/change.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <vector>

#include "change/flicker.h"

namespace unseen::perception {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

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

double step_response_at(double seconds) {
    return scale * (stages_step(first_stages, seconds / stage_s) -
                    second_share * stages_step(second_stages, seconds / (second_slower * stage_s)));
}

constexpr double table_step_s = 5e-4, table_end_s = 0.4; // when it has settled
constexpr std::size_t table_size = static_cast<std::size_t>(table_end_s / table_step_s) + 2;

struct StepTable {
    std::array<double, table_size> response{}, integral{}; // of the response, from 0 on
    double best = 0;                                       // |H| at the frequency that is seen best
    double peak_s = 0, settled = 0;
    StepTable() {
        for (std::size_t i = 0; i < table_size; ++i) {
            response[i] = step_response_at(static_cast<double>(i) * table_step_s);
            if (i > 0) integral[i] = integral[i - 1] + table_step_s * (response[i] + response[i - 1]) / 2;
        }
        const auto peak = std::max_element(response.begin(), response.end());
        peak_s = static_cast<double>(peak - response.begin()) * table_step_s;
        settled = scale * (1 - second_share);
        for (double hz = 0.1; hz < 60; hz += 0.05) best = std::max(best, amplitude(hz));
    }
    static double at(const std::array<double, table_size>& values, double seconds) {
        const double place = seconds / table_step_s;
        const auto i = static_cast<std::size_t>(place);
        return std::lerp(values[i], values[i + 1], place - static_cast<double>(i));
    }
    double response_at(double seconds) const {
        if (!(seconds > 0)) return 0;
        return seconds < table_end_s ? at(response, seconds) : settled;
    }
    double integral_to(double seconds) const {
        if (!(seconds > 0)) return 0;
        if (seconds < table_end_s) return at(integral, seconds);
        return integral[table_size - 1] + (seconds - static_cast<double>(table_size - 1) * table_step_s) * settled;
    }
    // The largest response to a ramp of so long.
    double ramp_peak(double seconds) const {
        if (seconds < table_step_s) return response_at(peak_s);
        double most = 0;
        // While the ramp lasts the response grows or settles, and falls after its end.
        for (double t = 0; t <= table_end_s; t += 4 * table_step_s) {
            const double since = t + std::max(0.0, seconds - table_end_s);
            most = std::max(most, (integral_to(since) - integral_to(since - seconds)) / seconds);
            const double after = seconds + t;
            most = std::max(most, (integral_to(after) - integral_to(after - seconds)) / seconds);
        }
        return most;
    }
};
const StepTable& step_table() {
    static const StepTable table;
    return table;
}

bool is_valid(double eccentricity, double cdm2) { return eccentricity >= 0 && eccentricity <= 180 && cdm2 > 0; }

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

double step_response(double seconds) { return step_table().response_at(seconds + step_table().peak_s); }

// By octaves: between samples it bends by little.
double ramp_peak(double seconds) {
    constexpr double first = -11, last = 5, per_octave = 8; // of a second, where it is that of a step, or of no end
    static const std::vector<double> peaks = [] {
        std::vector<double> values;
        for (double octave = first; octave <= last; octave += 1 / per_octave)
            values.push_back(step_table().ramp_peak(std::exp2(octave)));
        return values;
    }();
    if (!(seconds > std::exp2(first))) return peaks.front();
    const double place = std::min((std::log2(seconds) - first) * per_octave, static_cast<double>(peaks.size()) - 1.001);
    const auto i = static_cast<std::size_t>(place);
    return std::lerp(peaks[i], peaks[i + 1], place - static_cast<double>(i));
}

double flicker_sensitivity(Hertz frequency, Degrees eccentricity, Luminance luminance) {
    const double hz = frequency.value(), e = eccentricity.value(), cdm2 = luminance.value();
    if (!(hz >= 0 && std::isfinite(hz)) || !is_valid(e, cdm2)) return nan;
    const double foveal_hz = ((hz + offset_hz) / (1 + speed_per_degree * e) - offset_hz) / luminance_speed(cdm2);
    return flicker_scale(e, cdm2) * amplitude(foveal_hz);
}

// In rings about the disc's centre, by the rule of midpoints; within 1e-4.
double disc_flicker_sensitivity(Hertz frequency, Degrees eccentricity, Luminance luminance, Degrees radius) {
    const double e = eccentricity.value(), r = radius.value();
    if (!(r > 0) || !is_valid(e, luminance.value())) return nan;
    constexpr int rings = 128, half_turns = 32;
    double sum = 0;
    for (int i = 0; i < rings; ++i) {
        const double ring = (i + 0.5) / rings * r;
        double mean = 0;
        for (int j = 0; j < half_turns; ++j) {
            const double turn = std::numbers::pi * (j + 0.5) / half_turns;
            const double here = std::hypot(e + ring * std::cos(turn), ring * std::sin(turn));
            mean += std::pow(flicker_sensitivity(frequency, Degrees(here), luminance), flicker_pooling) / half_turns;
        }
        sum += mean * 2 * std::numbers::pi * ring * r / rings;
    }
    return std::pow(sum / flicker_pooling_deg2, 1 / flicker_pooling);
}

double ramp_response(double seconds, Degrees eccentricity, Luminance luminance) {
    if (!(seconds >= 0) || !is_valid(eccentricity.value(), luminance.value())) return nan;
    return ramp_peak(seconds * flicker_speed(eccentricity.value(), luminance.value())) / step_table().best;
}

double flicker_share(CyclesPerDegree frequency) {
    const double cpd = frequency.value();
    if (!(cpd >= 0)) return nan;
    double share = 0;
    for (const FlickerBlur& blur : flicker_blurs) share += blur.weight * std::exp(-cpd * cpd / (blur.cpd * blur.cpd));
    return share;
}

} // namespace unseen::perception
