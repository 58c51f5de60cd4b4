#include "judge/band_weights.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include <glm/geometric.hpp>

#include "judge/judge_input.h"
#include "pyramid_kernel.h"

namespace unseen::perception {
namespace {

constexpr double lowest_frequency = 1.0 / 16; // cpd, end of the CSF's domain; the base band is not below it
constexpr int smallest_base_side = 4;         // pixels; a smaller base would be all edge
constexpr double luminance_floor = 0.01;      // cd/m2, where the display's black level does not say more
constexpr double sensitivity_floor = 1e-60;   // keeps logarithms and squares finite; 1e-57 times below visibility
constexpr double least_gain = 1e-3, largest_gain = 1e3;
constexpr SquareDegrees barten_field{100}; // 10 x 10 degrees, for which Barten gives his curves
// Steps of the sensitivity tables. log S is linear in eccentricity, so only luminance errs: by less than 5e-4 of S,
// most where castleCSF's peak frequency crosses the band's.
constexpr double eccentricity_step = 1.0;    // degrees
constexpr double luminance_step = 1.0 / 128; // decades
// Where the tilt is fitted, in units of the band's nominal frequency: half an octave to either side. Band 0 has no band
// above it; it is fitted on the way down to band 1, where it answers alone.
constexpr double fit_ratios[2] = {std::numbers::sqrt2, 1 / std::numbers::sqrt2};
constexpr double first_band_fit_ratios[2] = {0.64, 0.76};

// ---- frequency responses ------------------------------------------------------------------------------------------

// Gratings along an axis, and across the pixels' diagonals: there each axis has 1 / sqrt 2 of the frequency.
enum class Orientation { axis, diagonal };
template <class Response>
double in_both_axes(double omega, Orientation orientation, Response response) {
    if (orientation == Orientation::axis) return response(omega);
    const double of_one = response(omega / std::numbers::sqrt2);
    return of_one * of_one;
}
double smooth_response(double omega, Orientation orientation = Orientation::axis) {
    return in_both_axes(omega, orientation, [](double w) { return 0.5 + 0.5 * std::cos(w); });
}
// Radians a pixel of level `level`, of a grating along an axis.
double angular_frequency(double freq_cpd, double ppd, int level) {
    return 2 * std::numbers::pi * freq_cpd / ppd * std::exp2(level);
}
// Amplitude of Laplacian band `level` per unit amplitude of a grating: low-pass by every level above, less what the
// next level gives back.
double band_response(double freq_cpd, double ppd, int level, Orientation orientation = Orientation::axis) {
    const auto kernel_at = [&](int at) {
        return in_both_axes(angular_frequency(freq_cpd, ppd, at), orientation, kernel_response);
    };
    double response = 1;
    for (int i = 0; i < level; ++i) response *= std::abs(kernel_at(i));
    const double back = kernel_at(level);
    return response * (1 - back * back);
}

} // namespace

double nominal_frequency(double ppd, int level) {
    return level == 0 ? ppd / 2 : second_band_ratio * std::exp2(1 - level) * ppd / 2;
}

int base_level(const Image& image, double ppd) {
    int level = 0;
    for (int side = std::min(image.width, image.height); (side + 1) / 2 >= smallest_base_side; side = (side + 1) / 2) {
        if (nominal_frequency(ppd, level + 1) < lowest_frequency) break;
        ++level;
    }
    return level;
}

double summation_area(const BandConditions& c, double freq_cpd) {
    return (c.model == CsfModel::barten_1999 && !c.table ? barten_summation_area
                                                         : castle_summation_area)(CyclesPerDegree(freq_cpd))
        .value();
}

double sensitivity_of(const BandConditions& c, double freq_cpd, double luminance, double eccentricity) {
    Stimulus stimulus;
    stimulus.frequency = CyclesPerDegree(freq_cpd);
    stimulus.luminance = Luminance(luminance);
    stimulus.eccentricity = Degrees(eccentricity);
    stimulus.area = patch_area(stimulus.frequency);
    stimulus.field = VisualField::worst;
    stimulus.distance = c.distance;
    double s = 0;
    if (c.table) {
        s = c.table->sensitivity(stimulus.frequency, stimulus.eccentricity, stimulus.luminance);
    } else if (c.model == CsfModel::barten_1999) {
        // Its own fall with eccentricity is refuted by people's thresholds: castleCSF's is taken.
        const double aside = sensitivity(CsfModel::castle, stimulus);
        stimulus.eccentricity = Degrees(0);
        s = aside / sensitivity(CsfModel::castle, stimulus);
        stimulus.area = barten_field; // decides on the pupil, too, which is the screen's business and no patch's
        s *= sensitivity(c.model, stimulus);
    } else {
        s = sensitivity(c.model, stimulus);
    }
    const double area = stimulus.area.value();
    const double unlimited = std::sqrt((summation_area(c, freq_cpd) + area) / area);
    return std::max(c.gain * s * unlimited, sensitivity_floor); // of NaN, too: 0 / 0 far aside
}

// ---- weights of a band ---------------------------------------------------------------------------------------------

BandTable::BandTable(const BandConditions& c, int level, bool is_base)
    : origin_(c.log10_luminance.low), level_(level), is_base_(is_base), gain_(1),
      smooth_at_nominal_(smooth_response(angular_frequency(nominal_frequency(c.ppd, level), c.ppd, level))) {
    if (!is_base) gain_ = band_response(nominal_frequency(c.ppd, level), c.ppd, level);
    const double nominal = nominal_frequency(c.ppd, level), patch = patch_area(CyclesPerDegree(nominal)).value();
    of_patch_ = std::sqrt(patch / (summation_area(c, nominal) + patch));
    luminances_ = 2 + static_cast<int>((c.log10_luminance.high - origin_) / luminance_step);
    eccentricities_ = 1;
    if (c.largest_eccentricity > 0) {
        eccentricities_ = 2 + static_cast<int>(c.largest_eccentricity / eccentricity_step);
    }
    for (int e = 0; e < eccentricities_; ++e) {
        for (int l = 0; l < luminances_; ++l) {
            nodes_.push_back(node(c, std::pow(10.0, origin_ + l * luminance_step), e * eccentricity_step));
        }
    }
}

BandWeight BandTable::at(double log10_luminance, double eccentricity) const {
    const Cell l = cell((log10_luminance - origin_) / luminance_step, luminances_);
    const Cell e = cell(eccentricity / eccentricity_step, eccentricities_);
    const auto width = static_cast<std::size_t>(luminances_);
    const Node a = mix(nodes_[e.low * width + l.low], nodes_[e.low * width + l.high], l.share);
    if (e.low == e.high) return {std::exp(a.log_s), a.tilt};
    const Node b = mix(nodes_[e.high * width + l.low], nodes_[e.high * width + l.high], l.share);
    const Node m = mix(a, b, e.share);
    return {std::exp(m.log_s), m.tilt};
}

BandTable::Cell BandTable::cell(double position, int count) {
    const double p = std::clamp(position, 0.0, static_cast<double>(count - 1));
    const auto low = static_cast<std::size_t>(p);
    return {low, std::min(low + 1, static_cast<std::size_t>(count - 1)), p - static_cast<double>(low)};
}
BandTable::Node BandTable::mix(const Node& a, const Node& b, double t) {
    return {a.log_s + t * (b.log_s - a.log_s), a.tilt + t * (b.tilt - a.tilt)};
}

BandTable::Node BandTable::node(const BandConditions& c, double luminance, double eccentricity) const {
    const double nominal = nominal_frequency(c.ppd, level_);
    double s = sensitivity_of(c, nominal, luminance, eccentricity);
    if (!is_base_) return {std::log(s), fit_tilt(c, luminance, eccentricity, s)};
    // The base band holds every lower frequency too. Where the pyramid is short (a small image), its own frequency
    // lies right of the peak of S, and the band would be blind to what is plain at a lower frequency.
    for (double f = nominal / std::numbers::sqrt2; f >= lowest_frequency; f /= std::numbers::sqrt2) {
        s = std::max(s, sensitivity_of(c, f, luminance, eccentricity));
    }
    return {std::log(s), 0};
}

// Least squares of the tilted band's answer against S at two frequencies. Half an octave from its centre a band
// shares the work with its neighbour, so each has to bring S 2^(-1/beta).
double BandTable::fit_tilt(const BandConditions& c, double luminance, double eccentricity, double nominal_s) const {
    const double nominal = nominal_frequency(c.ppd, level_);
    const double share = level_ == 0 ? 1 : std::exp2(-1 / c.beta);
    double numerator = 0, denominator = 0;
    for (const double ratio : level_ == 0 ? first_band_fit_ratios : fit_ratios) {
        const double f = ratio * nominal;
        const double wanted = share * sensitivity_of(c, f, luminance, eccentricity) / nominal_s;
        for (const Orientation o : {Orientation::axis, Orientation::diagonal}) {
            const double answer = band_response(f, c.ppd, level_, o) / gain_ / wanted;
            const double slope =
                answer * (smooth_response(angular_frequency(f, c.ppd, level_), o) - smooth_at_nominal_);
            numerator += slope * (1 - answer);
            denominator += slope * slope;
        }
    }
    return numerator / denominator;
}

// ---- geometry and arguments ----------------------------------------------------------------------------------------

Eccentricity::Eccentricity(const Image& window, const JudgeOptions& options)
    : centre_(0.5 * window.width, 0.5 * window.height),
      distance_px_(options.display.distance.value() / options.display.pixel_pitch.value()) {
    if (options.gaze_px) {
        has_gaze_ = true;
        gaze_ = direction(options.gaze_px->x, options.gaze_px->y);
        for (const double x : {0.0, static_cast<double>(window.width)}) {
            for (const double y : {0.0, static_cast<double>(window.height)}) {
                largest_ = std::max(largest_, angle(direction(x, y)));
            }
        }
        if (largest_ > 90) largest_ = 180; // beyond a right angle the largest need not lie in a corner
    }
}
double Eccentricity::angle(const glm::dvec3& d) const {
    return std::atan2(glm::length(glm::cross(gaze_, d)), glm::dot(gaze_, d)) * 180 / std::numbers::pi;
}

std::vector<std::size_t> nearest_samples(int pixels, int level, int samples) {
    std::vector<std::size_t> nearest(static_cast<std::size_t>(pixels));
    const std::size_t half = level == 0 ? 0 : std::size_t{1} << (level - 1);
    for (std::size_t x = 0; x < nearest.size(); ++x) {
        nearest[x] = std::min((x + half) >> level, static_cast<std::size_t>(samples - 1));
    }
    return nearest;
}

Result<void> check(const JudgeOptions& options) {
    if (auto ok = validate(options.display); !ok) return ok;
    if (!options.csf_table && !is_achromatic(options.csf))
        return judge_argument_error("judge", std::string(name(options.csf)) +
                                                 " is sensitivity to colour, not to luminance contrast");
    if (!(options.gain >= least_gain && options.gain <= largest_gain))
        return judge_argument_error("judge", "the observer's gain must lie between 0.001 and 1000");
    if (!(options.beta >= 1 && options.beta <= 20))
        return judge_argument_error("judge", "beta must lie between 1 and 20");
    if (options.gaze_px && !(std::isfinite(options.gaze_px->x) && std::isfinite(options.gaze_px->y))) {
        return judge_argument_error("judge", "the gaze must be a finite position in pixels");
    }
    return {};
}

double contrast_floor(const Display& display) { return std::max(black_level(display).value(), luminance_floor); }

BandConditions conditions_for(const Image& reference, const JudgeOptions& options, const Eccentricity& eccentricity) {
    const auto [low, high] = std::minmax_element(reference.values.begin(), reference.values.end());
    const double floor_cdm2 = contrast_floor(options.display);
    return {options.csf,
            options.csf_table,
            options.display.distance,
            pixels_per_degree(options.display).value(),
            options.beta,
            options.gain,
            {std::log10(std::max(static_cast<double>(*low), floor_cdm2)),
             std::log10(std::max(static_cast<double>(*high), floor_cdm2))},
            eccentricity.largest()};
}

} // namespace unseen::perception
