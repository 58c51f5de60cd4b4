#include "judge/band_weights.h"

#include <limits>

#include "judge/fast_math.h"
#include "judge/judge_input.h"
#include "pyramid_kernel.h"

namespace unseen::perception {
namespace {

constexpr double lowest_frequency = 1.0 / 16; // cpd, end of the CSF's domain; the base band is not below it
constexpr int smallest_base_side = 4;         // pixels; a smaller base would be all edge
constexpr double luminance_floor = 0.01;      // cd/m2, where the display's black level does not say more
constexpr double sensitivity_floor = 1e-60;   // keeps logarithms and squares finite; 1e-57 times below visibility
constexpr double least_gain = 1e-3, largest_gain = 1e3;
constexpr double least_beta = 1, largest_beta = 8; // beyond, powers of what is hardly seen are no floats

// Steps of the tables. Between them log S and the weights are linear, over luminance and over eccentricity. log S is
// linear in eccentricity. In luminance it errs by less than 1e-3 of S, most where castleCSF's peak crosses the band's
// frequency.
constexpr int fraction_bits = BandTable::fraction_bits;

// Where own and smoothed are fitted, in units of the band's nominal frequency. Band 0 has no band above it; it is
// fitted on the way down to band 1, where it answers alone.
constexpr std::array fit_ratios = {0.5, 1 / std::numbers::sqrt2, 1.0, std::numbers::sqrt2};
constexpr std::array first_band_fit_ratios = {0.4, 0.55, 0.7, 0.85, 1.0};
constexpr double largest_weight = 1e6; // of a band that is blind to its nominal frequency

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
// Amplitude of level `level` per unit amplitude of a grating: low-pass by every level above.
double level_response(double freq_cpd, double ppd, int level, Orientation orientation) {
    double response = 1;
    for (int i = 0; i < level; ++i)
        response *= std::abs(in_both_axes(angular_frequency(freq_cpd, ppd, i), orientation, kernel_response));
    return response;
}
// The response of a Laplacian band: that of its level, less what the next level gives back.
double band_response(double freq_cpd, double ppd, int level, Orientation orientation) {
    const double back = in_both_axes(angular_frequency(freq_cpd, ppd, level), orientation, kernel_response);
    return level_response(freq_cpd, ppd, level, orientation) * (1 - back * back);
}
// A band's answer to a grating, 1 at its nominal frequency along an axis; the base's is that of its level.
double answer(const BandConditions& c, double freq_cpd, int level, Orientation orientation) {
    if (level == c.base_level) return level_response(freq_cpd, c.ppd, level, orientation);
    return band_response(freq_cpd, c.ppd, level, orientation) /
           band_response(nominal_frequency(c.ppd, level), c.ppd, level, Orientation::axis);
}

// ---- sensitivity at the nodes of a table --------------------------------------------------------------------------

int luminance_cell(float luminance) {
    return static_cast<int>(std::bit_cast<std::uint32_t>(luminance) >> fraction_bits);
}
double first_luminance(int cell) { return std::bit_cast<float>(static_cast<std::uint32_t>(cell) << fraction_bits); }

// cd/m2 and degrees.
struct Nodes {
    std::vector<double> luminances, eccentricities;
};

// To unlimited gratings of one frequency, by eccentricity.
std::vector<double> sensitivities(const BandConditions& c, double freq_cpd, const Nodes& nodes) {
    std::vector<double> all;
    // What other models lose with eccentricity does not depend on luminance.
    const bool is_separable = !c.table && c.model != CsfModel::daly;
    if (!is_separable) {
        for (const double e : nodes.eccentricities)
            for (const double l : nodes.luminances) all.push_back(sensitivity_of(c, freq_cpd, l, e));
        return all;
    }
    std::vector<double> looked_at;
    for (const double l : nodes.luminances) looked_at.push_back(sensitivity_of(c, freq_cpd, l, 0));
    for (const double e : nodes.eccentricities) {
        const double kept = e > 0 ? sensitivity_of(c, freq_cpd, nodes.luminances.front(), e) / looked_at.front() : 1.0;
        for (const double s : looked_at) all.push_back(std::max(sensitivity_floor, kept * s));
    }
    return all;
}

// ---- the fit of a band's weights ----------------------------------------------------------------------------------

// One grating, and what the fit knows of it before it knows S.
struct FitPoint {
    std::size_t frequency = 0; // index
    double scale = 0;          // of the weights' answer, over what is wanted of a flat S
    double smooth = 0;         // response of the binomial filter
    double weight = 0;         // the band's share of the pooled powers
};

std::vector<FitPoint> fit_points(const BandConditions& c, int level, std::span<const double> frequencies) {
    std::vector<FitPoint> points;
    const double nominal = nominal_frequency(c.ppd, level);
    const double gain = band_response(nominal, c.ppd, level, Orientation::axis);
    for (std::size_t i = 0; i < frequencies.size(); ++i) {
        // The law of area within a band is that of its nominal frequency. Of gratings as large as their own Ac, half of
        // an unlimited one's energy should be seen.
        const double area = summation_area(c, frequencies[i]), of_band = summation_area(c, nominal);
        const double seen = std::sqrt(2 * area / (area + of_band));
        for (const Orientation o : {Orientation::axis, Orientation::diagonal}) {
            double powers = 0;
            for (int k = 0; k <= c.base_level; ++k) powers += std::pow(answer(c, frequencies[i], k, o), c.beta);
            const double own_power = std::pow(answer(c, frequencies[i], level, o), c.beta);
            points.push_back({i, seen * gain * std::pow(powers, 1 / c.beta),
                              smooth_response(angular_frequency(frequencies[i], c.ppd, level), o), own_power / powers});
        }
    }
    return points;
}

struct Fitted {
    double own = 0, smoothed = 0;
};
// Least squares of weight (scale (own + smoothed smooth) / s - 1)^2. s is the sensitivity by frequency, over that to
// the nominal one, which is `of_nominal`. What no contrast makes visible, S being below 1, counts for less and less.
Fitted fit(std::span<const FitPoint> points, std::span<const double> s, double of_nominal) {
    double xx = 0, xy = 0, yy = 0, x1 = 0, y1 = 0;
    for (const FitPoint& p : points) {
        const double x = p.scale / s[p.frequency], y = x * p.smooth;
        const double square = s[p.frequency] * of_nominal * s[p.frequency] * of_nominal;
        const double weight = p.weight * square / (1 + square);
        xx += weight * x * x, xy += weight * x * y, yy += weight * y * y;
        x1 += weight * x, y1 += weight * y;
    }
    const double determinant = xx * yy - xy * xy;
    const auto limited = [&](double numerator) {
        const double value = numerator / determinant;
        return std::isfinite(value) ? std::clamp(value, -largest_weight, largest_weight) : 0;
    };
    return {limited(x1 * yy - y1 * xy), limited(y1 * xx - x1 * xy)};
}

} // namespace

double nominal_frequency(double ppd, int level) {
    return level == 0 ? ppd / 2 : second_band_ratio * std::exp2(1 - level) * ppd / 2;
}

int base_level(int width, int height, double ppd) {
    int level = 0;
    for (int side = std::min(width, height); (side + 1) / 2 >= smallest_base_side; side = (side + 1) / 2) {
        if (nominal_frequency(ppd, level + 1) < lowest_frequency) break;
        ++level;
    }
    return level;
}

double summation_area(const BandConditions& c, double freq_cpd) {
    const CyclesPerDegree frequency(freq_cpd);
    if (c.table) { // unlimited gratings are seen so many times as well as by castle's law
        const double patch = patch_area(frequency).value(), own = c.table->samples().summation;
        return std::max(0.0, own * own * (castle_summation_area(frequency).value() + patch) - patch);
    }
    switch (c.model) {
    case CsfModel::barten_1999: return barten_summation_area({}, frequency).value();
    case CsfModel::barten_fitted: return barten_summation_area(fitted_barten, frequency).value();
    default: return castle_summation_area(frequency, c.model).value();
    }
}

double summation_area_in_samples(const BandConditions& c, int level) {
    const double samples_a_degree = c.ppd / std::exp2(level);
    return summation_area(c, nominal_frequency(c.ppd, level)) * samples_a_degree * samples_a_degree;
}

double sensitivity_of(const BandConditions& c, double freq_cpd, double luminance, double eccentricity) {
    Stimulus stimulus;
    stimulus.frequency = CyclesPerDegree(freq_cpd);
    stimulus.luminance = Luminance(luminance);
    stimulus.eccentricity = Degrees(eccentricity);
    stimulus.area = patch_area(stimulus.frequency);
    stimulus.field = VisualField::worst;
    stimulus.distance = c.distance;
    const double s = c.table ? c.table->sensitivity(stimulus.frequency, stimulus.eccentricity, stimulus.luminance)
                             : sensitivity(c.model, stimulus);
    const double area = stimulus.area.value();
    const double unlimited = std::sqrt((summation_area(c, freq_cpd) + area) / area);
    return std::max(sensitivity_floor, c.gain * s * unlimited); // in this order of NaN, too: where all is 0 or infinite
}

// ---- weights of a band ---------------------------------------------------------------------------------------------

BandTable::BandTable(const BandConditions& c, int level) {
    const double nominal = nominal_frequency(c.ppd, level), patch = patch_area(CyclesPerDegree(nominal)).value();
    of_patch_ = std::sqrt(patch / (summation_area(c, nominal) + patch));

    Nodes nodes;
    first_cell_ = luminance_cell(c.luminance.low);
    for (int cell = first_cell_; cell <= luminance_cell(c.luminance.high) + 1; ++cell)
        nodes.luminances.push_back(first_luminance(cell));
    first_eccentricity_ = c.eccentricity.low;
    nodes.eccentricities.push_back(c.eccentricity.low);
    while (nodes.eccentricities.back() < c.eccentricity.high)
        nodes.eccentricities.push_back(nodes.eccentricities.back() + eccentricity_step);
    luminances_ = nodes.luminances.size(), eccentricities_ = nodes.eccentricities.size();

    std::vector<double> of_nominal = sensitivities(c, nominal, nodes);
    nodes_.resize(of_nominal.size());
    if (level == c.base_level) {
        // The base band holds every lower frequency too. Where the pyramid is short (a small image), its own frequency
        // lies right of the peak of S, and the band would be blind to what is plain at a lower frequency.
        for (double f = nominal / std::numbers::sqrt2; f >= lowest_frequency; f /= std::numbers::sqrt2) {
            const std::vector<double> lower = sensitivities(c, f, nodes);
            for (std::size_t n = 0; n < lower.size(); ++n) of_nominal[n] = std::max(of_nominal[n], lower[n]);
        }
    } else {
        std::vector<double> frequencies;
        if (level == 0)
            for (const double ratio : first_band_fit_ratios) frequencies.push_back(ratio * nominal);
        else
            for (const double ratio : fit_ratios) frequencies.push_back(ratio * nominal);
        std::vector<std::vector<double>> s;
        for (const double f : frequencies) s.push_back(sensitivities(c, f, nodes));
        const std::vector<FitPoint> points = fit_points(c, level, frequencies);
        std::vector<double> relative(frequencies.size());
        for (std::size_t n = 0; n < nodes_.size(); ++n) {
            for (std::size_t i = 0; i < relative.size(); ++i) relative[i] = s[i][n] / of_nominal[n];
            const Fitted fitted = fit(points, relative, of_nominal[n] / c.gain);
            nodes_[n].own = static_cast<float>(fitted.own), nodes_[n].smoothed = static_cast<float>(fitted.smoothed);
        }
    }
    for (std::size_t n = 0; n < nodes_.size(); ++n) nodes_[n].log2_s = static_cast<float>(std::log2(of_nominal[n]));
}

void BandTable::weigh(std::span<const float> luminance, std::span<const float> eccentricity,
                      BandWeights& weights) const {
    constexpr std::uint32_t fraction_mask = (1U << fraction_bits) - 1;
    constexpr float cell_share = 1.f / (1U << fraction_bits);
    constexpr auto node_share = static_cast<float>(1 / eccentricity_step);
    const auto mix = [](const Node& a, const Node& b, float t) {
        return Node{a.log2_s + t * (b.log2_s - a.log2_s), a.own + t * (b.own - a.own),
                    a.smoothed + t * (b.smoothed - a.smoothed)};
    };
    const std::size_t count = luminance.size();
    for (std::vector<float>* const row : {&weights.sensitivity, &weights.own, &weights.smoothed}) row->resize(count);
    const auto last_cell = static_cast<int>(luminances_) - 2;
    for (std::size_t i = 0; i < count; ++i) {
        const auto bits = std::bit_cast<std::uint32_t>(luminance[i]);
        const int cell = static_cast<int>(bits >> fraction_bits) - first_cell_;
        const float share = cell < 0 ? 0 : cell > last_cell ? 1 : static_cast<float>(bits & fraction_mask) * cell_share;
        const Node* const at = nodes_.data() + std::clamp(cell, 0, last_cell);
        Node node;
        if (eccentricities_ < 2 || eccentricity.empty()) {
            node = mix(at[0], at[1], share);
        } else {
            const float place = std::clamp((eccentricity[i] - first_eccentricity_) * node_share, 0.f,
                                           static_cast<float>(eccentricities_ - 1));
            const std::size_t row = std::min(static_cast<std::size_t>(place), eccentricities_ - 2);
            const Node* const near = at + row * luminances_;
            const Node* const far = near + luminances_;
            node = mix(mix(near[0], near[1], share), mix(far[0], far[1], share), place - static_cast<float>(row));
        }
        weights.sensitivity[i] = node.log2_s, weights.own[i] = node.own, weights.smoothed[i] = node.smoothed;
    }
    for (float& s : weights.sensitivity) s = fast_exp2(s);
}

// ---- geometry and arguments ----------------------------------------------------------------------------------------

std::optional<GazeOnScreen> gaze_on_screen(int width, int height, const JudgeOptions& options) {
    if (!options.gaze_px) return {};
    GazeOnScreen gaze;
    gaze.tangent_per_pixel = options.display.pixel_pitch.value() / options.display.distance.value();
    const double right = gaze.tangent(options.gaze_px->x, width), down = gaze.tangent(options.gaze_px->y, height),
                 length = std::hypot(right, down, 1.0);
    gaze.direction = {static_cast<float>(right / length), static_cast<float>(down / length),
                      static_cast<float>(1 / length)};
    return gaze;
}

namespace {

// Calls `use(row, degrees)` for each row of a window.
template <class Use>
void for_each_row_of_eccentricities(const GazeOnScreen& gaze, int width, int height, Use use) {
    const float gaze_x = gaze.direction.x, gaze_y = gaze.direction.y, gaze_z = gaze.direction.z;
    std::vector<float> xs, degrees(static_cast<std::size_t>(width));
    for (int x = 0; x < width; ++x) xs.push_back(static_cast<float>(gaze.tangent(x + 0.5, width)));
    constexpr auto per_radian = static_cast<float>(180 / std::numbers::pi);
    for (int row = 0; row < height; ++row) {
        const auto y = static_cast<float>(gaze.tangent(row + 0.5, height));
        for (std::size_t i = 0; i < xs.size(); ++i) {
            const float x = xs[i], a = gaze_y - gaze_z * y, b = gaze_z * x - gaze_x, c = gaze_x * y - gaze_y * x;
            const float dot = gaze_x * x + gaze_y * y + gaze_z;
            degrees[i] = fast_angle(std::sqrt(a * a + b * b + c * c), dot) * per_radian;
        }
        use(row, std::span<const float>(degrees));
    }
}

} // namespace

Plane eccentricities(int width, int height, const JudgeOptions& options) {
    const auto gaze = gaze_on_screen(width, height, options);
    if (!gaze) return {};
    Plane plane(width, height);
    for_each_row_of_eccentricities(*gaze, width, height, [&](int row, std::span<const float> degrees) {
        std::copy(degrees.begin(), degrees.end(), plane.row(row));
    });
    return plane;
}

Range eccentricity_range(int width, int height, const JudgeOptions& options) {
    const auto gaze = gaze_on_screen(width, height, options);
    if (!gaze) return {};
    Range range{std::numeric_limits<float>::infinity(), 0};
    for_each_row_of_eccentricities(*gaze, width, height, [&](int, std::span<const float> degrees) {
        const auto [nearest, farthest] = std::minmax_element(degrees.begin(), degrees.end());
        range = {std::min(range.low, *nearest), std::max(range.high, *farthest)};
    });
    return range;
}

std::vector<std::size_t> nearest_samples(int pixels, int level, int samples) {
    std::vector<std::size_t> nearest(static_cast<std::size_t>(pixels));
    const std::size_t half = level == 0 ? 0 : std::size_t{1} << (level - 1);
    for (std::size_t x = 0; x < nearest.size(); ++x)
        nearest[x] = std::min((x + half) >> level, static_cast<std::size_t>(samples - 1));
    return nearest;
}

Result<void> check(const JudgeOptions& options) {
    if (auto ok = validate(options.display); !ok) return ok;
    if (!options.csf_table && !is_achromatic(options.csf))
        return judge_argument_error("judge", std::string(name(options.csf)) +
                                                 " is sensitivity to colour, not to luminance contrast");
    if (!(options.gain >= least_gain && options.gain <= largest_gain))
        return judge_argument_error("judge", "the observer's gain must lie between 0.001 and 1000");
    if (options.colour_gain && !(*options.colour_gain >= least_gain && *options.colour_gain <= largest_gain))
        return judge_argument_error("judge", "the observer's gain for colours must lie between 0.001 and 1000");
    if (!(options.beta >= least_beta && options.beta <= largest_beta))
        return judge_argument_error("judge", "beta must lie between 1 and 8");
    if (options.gaze_px && !(std::isfinite(options.gaze_px->x) && std::isfinite(options.gaze_px->y)))
        return judge_argument_error("judge", "the gaze must be a finite position in pixels");
    return {};
}

double contrast_floor(const Display& display) { return std::max(black_level(display).value(), luminance_floor); }

float most_thresholds(double beta) { return std::min(1e8f, std::exp2(120 / static_cast<float>(beta))); }

BandConditions conditions_for(const Plane& luminance, const JudgeOptions& options, const Plane& eccentricities) {
    const auto [darkest, brightest] = std::minmax_element(luminance.values.begin(), luminance.values.end());
    Range eccentricity;
    if (!eccentricities.values.empty()) {
        const auto [nearest, farthest] =
            std::minmax_element(eccentricities.values.begin(), eccentricities.values.end());
        eccentricity = {*nearest, *farthest};
    }
    return conditions_for(luminance.width, luminance.height, {*darkest, *brightest}, eccentricity, options);
}

BandConditions conditions_for(int width, int height, Range luminance, Range eccentricity, const JudgeOptions& options) {
    BandConditions c;
    c.model = options.csf;
    c.table = options.csf_table;
    c.distance = options.display.distance;
    c.ppd = pixels_per_degree(options.display).value();
    c.beta = options.beta;
    c.gain = options.gain;
    const auto floor_cdm2 = static_cast<float>(contrast_floor(options.display));
    c.luminance = {std::max(luminance.low, floor_cdm2), std::max(luminance.high, floor_cdm2)};
    c.eccentricity = eccentricity;
    c.base_level = base_level(width, height, c.ppd);
    return c;
}

} // namespace unseen::perception
