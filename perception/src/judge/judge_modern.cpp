// The modern visibility map: a decimated Laplacian pyramid of the reference and of the difference, each band weighted
// by the contrast sensitivity at its frequency, masked by the reference, and pooled over the bands.
//
// What is our own in it, and why:
// - A band's gain is below 1 (and below the gain for other frequencies). Contrasts are divided by the band's response
// to
//   a grating of its nominal frequency, which follows from the kernel (`band_response`).
// - Bands are an octave and more wide, and S changes within one: at 10 degrees it halves between 5.5 and 8 cpd. One
//   number per band is then wrong by up to 5 dB between the nominal frequencies. So each band's contrast passes a
//   3 x 3 binomial filter h and counts as C + t (h*C - h(rho_k) C): unchanged at its nominal frequency and tilted
//   beside it. The tilt t follows from the CSF alone (`fit_tilt`), by luminance and eccentricity.
#include <perception/judge.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "judge/judge_input.h"
#include "judge/masking.h"
#include "pyramid_kernel.h"

namespace unseen::perception {
namespace {

constexpr double lowest_frequency = 1.0 / 16; // cpd, end of the CSF's domain; the base band is not below it
constexpr int smallest_base_side = 4;         // pixels; a smaller base would be all edge
constexpr double contrast_limit = 1000;       // of one band, so that a black reference stays finite
constexpr double luminance_floor = 0.01;      // cd/m2, where the display's black level does not say more
constexpr double sensitivity_floor = 1e-60;   // keeps logarithms and squares finite; 1e-57 times below visibility
// Steps of the sensitivity tables. log S is linear in eccentricity, so only luminance errs: by less than 5e-4 of S,
// most where castleCSF's peak frequency crosses the band's.
constexpr double eccentricity_step = 1.0;    // degrees
constexpr double luminance_step = 1.0 / 128; // decades
// Where the tilt is fitted, in units of the band's nominal frequency: half an octave to either side. Band 0 has no band
// above it; it is fitted on the way down to band 1, where it answers alone.
constexpr double fit_ratios[2] = {std::numbers::sqrt2, 1 / std::numbers::sqrt2};
constexpr double first_band_fit_ratios[2] = {0.64, 0.76};

// ---- images -------------------------------------------------------------------------------------------------------

struct Plane {
    int width = 0, height = 0;
    std::vector<double> values;
    Plane(int w, int h) : width(w), height(h), values(static_cast<std::size_t>(w) * static_cast<std::size_t>(h)) {}
    double* row(int y) { return values.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width); }
    const double* row(int y) const {
        return values.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
    }
};

// Mirrored about the outermost pixels; an image narrower than the kernel repeats its last one.
int mirrored(int i, int n) {
    if (i < 0) i = -i;
    if (i >= n) i = 2 * (n - 1) - i;
    return std::clamp(i, 0, n - 1);
}

// One axis of the reduction: out[i] = sum of the five pixels around in[2 i].
template <class Read>
double reduced(int i, int n, Read in) {
    const int c = 2 * i;
    return kernel_middle * in(c) + kernel_near * (in(mirrored(c - 1, n)) + in(mirrored(c + 1, n))) +
           kernel_far * (in(mirrored(c - 2, n)) + in(mirrored(c + 2, n)));
}
// One axis of the expansion: pixel x between coarse samples at even positions; the coarse row ends with its last
// sample.
template <class Read>
double expanded(int x, int coarse_n, Read in) {
    const int c = x / 2, next = std::min(c + 1, coarse_n - 1);
    if (x % 2 == 1) return 2 * kernel_near * (in(c) + in(next));
    return 2 * (kernel_middle * in(c) + kernel_far * (in(std::max(c - 1, 0)) + in(next)));
}

Plane reduce(const Plane& in) {
    Plane rows((in.width + 1) / 2, in.height), out(rows.width, (in.height + 1) / 2);
    for (int y = 0; y < in.height; ++y) {
        const double* line = in.row(y);
        for (int x = 0; x < rows.width; ++x) rows.row(y)[x] = reduced(x, in.width, [&](int i) { return line[i]; });
    }
    for (int y = 0; y < out.height; ++y) {
        for (int x = 0; x < out.width; ++x) {
            out.row(y)[x] = reduced(y, in.height, [&](int i) { return rows.row(i)[x]; });
        }
    }
    return out;
}

Plane expand(const Plane& coarse, int width, int height) {
    Plane rows(width, coarse.height), out(width, height);
    for (int y = 0; y < coarse.height; ++y) {
        const double* line = coarse.row(y);
        for (int x = 0; x < width; ++x) rows.row(y)[x] = expanded(x, coarse.width, [&](int i) { return line[i]; });
    }
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            out.row(y)[x] = expanded(y, coarse.height, [&](int i) { return rows.row(i)[x]; });
        }
    }
    return out;
}

// The binomial filter (1 2 1)/4 along both axes, whose response the tilt uses.
Plane smooth(const Plane& in) {
    Plane rows(in.width, in.height), out(in.width, in.height);
    for (int y = 0; y < in.height; ++y) {
        const double* line = in.row(y);
        for (int x = 0; x < in.width; ++x) {
            rows.row(y)[x] = 0.5 * line[x] + 0.25 * (line[mirrored(x - 1, in.width)] + line[mirrored(x + 1, in.width)]);
        }
    }
    for (int y = 0; y < in.height; ++y) {
        const double *above = rows.row(mirrored(y - 1, in.height)), *below = rows.row(mirrored(y + 1, in.height));
        for (int x = 0; x < in.width; ++x) out.row(y)[x] = 0.5 * rows.row(y)[x] + 0.25 * (above[x] + below[x]);
    }
    return out;
}

// ---- frequency responses ------------------------------------------------------------------------------------------

double smooth_response(double omega) { return 0.5 + 0.5 * std::cos(omega); }
// Radians a pixel of level `level`, of a grating along an axis.
double angular_frequency(double freq_cpd, double ppd, int level) {
    return 2 * std::numbers::pi * freq_cpd / ppd * std::exp2(level);
}
// Amplitude of Laplacian band `level` per unit amplitude of a grating: low-pass by every level above, less what the
// next level gives back.
double band_response(double freq_cpd, double ppd, int level) {
    double response = 1;
    for (int i = 0; i < level; ++i) response *= std::abs(kernel_response(angular_frequency(freq_cpd, ppd, i)));
    const double back = kernel_response(angular_frequency(freq_cpd, ppd, level));
    return response * (1 - back * back);
}
double nominal_frequency(double ppd, int level) {
    return level == 0 ? ppd / 2 : second_band_ratio * std::exp2(1 - level) * ppd / 2;
}

// ---- sensitivity by band ------------------------------------------------------------------------------------------

struct Range {
    double low = 0, high = 0;
};

// What the weights of all bands depend on.
struct Conditions {
    CsfModel model = CsfModel::castle;
    std::shared_ptr<const CsfTable> table; // in the model's place; or null
    Metres distance;                       // of the screen
    double ppd = 0;
    double beta = 0;
    Range log10_luminance;
    double largest_eccentricity = 0; // degrees
};

double static_sensitivity(const Conditions& c, double freq_cpd, double luminance, double eccentricity) {
    Stimulus stimulus;
    stimulus.frequency = CyclesPerDegree(freq_cpd);
    stimulus.luminance = Luminance(luminance);
    stimulus.eccentricity = Degrees(eccentricity);
    stimulus.area = patch_area(stimulus.frequency);
    stimulus.field = VisualField::worst;
    stimulus.distance = c.distance;
    const double s = c.table ? c.table->sensitivity(stimulus.frequency, stimulus.eccentricity, stimulus.luminance)
                             : sensitivity(c.model, stimulus);
    return s > sensitivity_floor ? s : sensitivity_floor;
}

struct BandWeight {
    double sensitivity = 0, tilt = 0;
};

// S and tilt of one band over log luminance and eccentricity, for the ranges that the images need.
class BandTable {
public:
    BandTable(const Conditions& c, int level, bool is_base)
        : origin_(c.log10_luminance.low), level_(level), is_base_(is_base), gain_(1),
          smooth_at_nominal_(smooth_response(angular_frequency(nominal_frequency(c.ppd, level), c.ppd, level))) {
        if (!is_base) gain_ = band_response(nominal_frequency(c.ppd, level), c.ppd, level);
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

    double gain() const { return gain_; }
    double smooth_at_nominal() const { return smooth_at_nominal_; }

    BandWeight at(double log10_luminance, double eccentricity) const {
        const Cell l = cell((log10_luminance - origin_) / luminance_step, luminances_);
        const Cell e = cell(eccentricity / eccentricity_step, eccentricities_);
        const auto width = static_cast<std::size_t>(luminances_);
        const Node a = mix(nodes_[e.low * width + l.low], nodes_[e.low * width + l.high], l.share);
        if (e.low == e.high) return {std::exp(a.log_s), a.tilt};
        const Node b = mix(nodes_[e.high * width + l.low], nodes_[e.high * width + l.high], l.share);
        const Node m = mix(a, b, e.share);
        return {std::exp(m.log_s), m.tilt};
    }

private:
    struct Node {
        double log_s = 0, tilt = 0;
    };
    struct Cell {
        std::size_t low = 0, high = 0;
        double share = 0;
    };
    static Cell cell(double position, int count) {
        const double p = std::clamp(position, 0.0, static_cast<double>(count - 1));
        const auto low = static_cast<std::size_t>(p);
        return {low, std::min(low + 1, static_cast<std::size_t>(count - 1)), p - static_cast<double>(low)};
    }
    static Node mix(const Node& a, const Node& b, double t) {
        return {a.log_s + t * (b.log_s - a.log_s), a.tilt + t * (b.tilt - a.tilt)};
    }

    Node node(const Conditions& c, double luminance, double eccentricity) const {
        const double nominal = nominal_frequency(c.ppd, level_);
        double s = static_sensitivity(c, nominal, luminance, eccentricity);
        if (!is_base_) return {std::log(s), fit_tilt(c, luminance, eccentricity, s)};
        // The base band holds every lower frequency too. Where the pyramid is short (a small image), its own frequency
        // lies right of the peak of S, and the band would be blind to what is plain at a lower frequency.
        for (double f = nominal / std::numbers::sqrt2; f >= lowest_frequency; f /= std::numbers::sqrt2) {
            s = std::max(s, static_sensitivity(c, f, luminance, eccentricity));
        }
        return {std::log(s), 0};
    }

    // Least squares of the tilted band's answer against S at two frequencies. Half an octave from its centre a band
    // shares the work with its neighbour, so each has to bring S 2^(-1/beta).
    double fit_tilt(const Conditions& c, double luminance, double eccentricity, double nominal_s) const {
        const double nominal = nominal_frequency(c.ppd, level_);
        const double share = level_ == 0 ? 1 : std::exp2(-1 / c.beta);
        double numerator = 0, denominator = 0;
        for (const double ratio : level_ == 0 ? first_band_fit_ratios : fit_ratios) {
            const double f = ratio * nominal;
            const double wanted = share * static_sensitivity(c, f, luminance, eccentricity) / nominal_s;
            const double answer = band_response(f, c.ppd, level_) / gain_ / wanted;
            const double slope = answer * (smooth_response(angular_frequency(f, c.ppd, level_)) - smooth_at_nominal_);
            numerator += slope * (1 - answer);
            denominator += slope * slope;
        }
        return numerator / denominator;
    }

    double origin_ = 0;
    int level_ = 0;
    bool is_base_ = false;
    double gain_ = 1, smooth_at_nominal_ = 0;
    int luminances_ = 0, eccentricities_ = 0;
    std::vector<Node> nodes_;
};

// ---- geometry -----------------------------------------------------------------------------------------------------

// The angle between gaze point and pixel, both on the flat screen, for an eye in front of the window's centre.
class Eccentricity {
public:
    Eccentricity(const Image& window, const JudgeOptions& options)
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
    double largest() const { return largest_; }
    // Degrees, at the centre of the pixel of these indices.
    double at_pixel(double x, double y) const { return has_gaze_ ? angle(direction(x + 0.5, y + 0.5)) : 0; }

private:
    glm::dvec3 direction(double x, double y) const { return {x - centre_.x, y - centre_.y, distance_px_}; }
    double angle(const glm::dvec3& d) const {
        return std::atan2(glm::length(glm::cross(gaze_, d)), glm::dot(gaze_, d)) * 180 / std::numbers::pi;
    }
    glm::dvec2 centre_;
    double distance_px_ = 1;
    bool has_gaze_ = false;
    glm::dvec3 gaze_{0, 0, 1};
    double largest_ = 0;
};

// ---- the bands of an image pair -----------------------------------------------------------------------------------

int base_level(const Image& image, double ppd) {
    int level = 0;
    for (int side = std::min(image.width, image.height); (side + 1) / 2 >= smallest_base_side; side = (side + 1) / 2) {
        if (nominal_frequency(ppd, level + 1) < lowest_frequency) break;
        ++level;
    }
    return level;
}

// One band at its own resolution: contrasts relative to the reference's local luminance, and their tilted companions.
struct Band {
    int level = 0;
    bool is_base = false;
    Plane luminance;  // cd/m2, floored
    Plane reference;  // contrast
    Plane difference; // contrast
};

// The luminance and the two contrasts of one band; leaves the next levels in `reference` and `difference`.
Band split_band(Plane& reference, Plane& difference, int level, double floor_cdm2) {
    Plane next_reference = reduce(reference), next_difference = reduce(difference);
    Band band{level, false, expand(next_reference, reference.width, reference.height), std::move(reference),
              std::move(difference)};
    const Plane back = expand(next_difference, band.luminance.width, band.luminance.height);
    for (std::size_t i = 0; i < back.values.size(); ++i) {
        double& luminance = band.luminance.values[i];
        band.reference.values[i] -= luminance;
        band.difference.values[i] -= back.values[i];
        luminance = std::max(luminance, floor_cdm2);
        band.reference.values[i] = std::clamp(band.reference.values[i] / luminance, -contrast_limit, contrast_limit);
        band.difference.values[i] = std::clamp(band.difference.values[i] / luminance, -contrast_limit, contrast_limit);
    }
    reference = std::move(next_reference);
    difference = std::move(next_difference);
    return band;
}

// What the pyramid did not split: the contrast of the difference against the level itself; a base does not mask itself.
Band base_band(Plane& reference, Plane& difference, int level, double floor_cdm2) {
    Band band{level, true, std::move(reference), Plane(0, 0), std::move(difference)};
    band.reference = Plane(band.luminance.width, band.luminance.height);
    for (std::size_t i = 0; i < band.luminance.values.size(); ++i) {
        double& luminance = band.luminance.values[i];
        luminance = std::max(luminance, floor_cdm2);
        band.difference.values[i] = std::clamp(band.difference.values[i] / luminance, -contrast_limit, contrast_limit);
    }
    return band;
}

// Calls `use(band)` for each band from fine to coarse; only one is held at a time.
template <class Use>
void for_each_band(const Image& reference, const Image* test, int base, double floor_cdm2, Use use) {
    Plane r(reference.width, reference.height), d(reference.width, reference.height);
    for (std::size_t i = 0; i < r.values.size(); ++i) {
        r.values[i] = reference.values[i];
        if (test != nullptr) d.values[i] = static_cast<double>(test->values[i]) - r.values[i];
    }
    for (int level = 0; level < base; ++level) use(split_band(r, d, level, floor_cdm2));
    use(base_band(r, d, base, floor_cdm2));
}

// A band's table is made when its luminances are known; `Visit` gets the sample index, the weight there, and the
// reference's and the difference's contrast, gain and tilt applied.
template <class Visit>
void for_each_sample(const Band& band, const Conditions& conditions, const Eccentricity& eccentricity, bool skip_equal,
                     Visit visit) {
    const BandTable table(conditions, band.level, band.is_base);
    const Plane smooth_reference = smooth(band.reference), smooth_difference = smooth(band.difference);
    const double step = std::exp2(band.level);
    for (int y = 0; y < band.luminance.height; ++y) {
        for (int x = 0; x < band.luminance.width; ++x) {
            const std::size_t i = static_cast<std::size_t>(y) * static_cast<std::size_t>(band.luminance.width) +
                                  static_cast<std::size_t>(x);
            const double d = band.difference.values[i], d_smooth = smooth_difference.values[i];
            if (skip_equal && d == 0 && d_smooth == 0) continue;
            const BandWeight weight =
                table.at(std::log10(band.luminance.values[i]), eccentricity.at_pixel(x * step, y * step));
            const double r = band.reference.values[i], r_smooth = smooth_reference.values[i];
            const auto tilted = [&](double c, double c_smooth) {
                return std::abs(c + weight.tilt * (c_smooth - table.smooth_at_nominal() * c)) / table.gain();
            };
            visit(i, weight.sensitivity, tilted(r, r_smooth), tilted(d, d_smooth));
        }
    }
}

// The nearest sample of a level for every pixel along one axis: a sample stands for the block around it.
std::vector<std::size_t> nearest_samples(int pixels, int level, int samples) {
    std::vector<std::size_t> nearest(static_cast<std::size_t>(pixels));
    const std::size_t half = level == 0 ? 0 : std::size_t{1} << (level - 1);
    for (std::size_t x = 0; x < nearest.size(); ++x) {
        nearest[x] = std::min((x + half) >> level, static_cast<std::size_t>(samples - 1));
    }
    return nearest;
}

// Merges a band's values into the full resolution, each into its whole block.
template <class Merge>
void spread(const Plane& band, int level, Plane& full, Merge merge) {
    const auto columns = nearest_samples(full.width, level, band.width);
    const auto rows = nearest_samples(full.height, level, band.height);
    for (int y = 0; y < full.height; ++y) {
        const double* from = band.row(static_cast<int>(rows[static_cast<std::size_t>(y)]));
        double* to = full.row(y);
        for (std::size_t x = 0; x < columns.size(); ++x) merge(to[x], from[columns[x]]);
    }
}

// ---- arguments ----------------------------------------------------------------------------------------------------

Result<void> check(const JudgeOptions& options) {
    if (auto ok = validate(options.display); !ok) return ok;
    if (!options.csf_table && !is_achromatic(options.csf))
        return judge_argument_error("judge", std::string(name(options.csf)) +
                                                 " is sensitivity to colour, not to luminance contrast");
    if (!(options.beta >= 1 && options.beta <= 20))
        return judge_argument_error("judge", "beta must lie between 1 and 20");
    if (options.gaze_px && !(std::isfinite(options.gaze_px->x) && std::isfinite(options.gaze_px->y))) {
        return judge_argument_error("judge", "the gaze must be a finite position in pixels");
    }
    return {};
}

// What the screen cannot show cannot be a reference luminance either.
double contrast_floor(const Display& display) { return std::max(black_level(display).value(), luminance_floor); }

Conditions conditions_for(const Image& reference, const JudgeOptions& options, const Eccentricity& eccentricity) {
    const auto [low, high] = std::minmax_element(reference.values.begin(), reference.values.end());
    const double floor_cdm2 = contrast_floor(options.display);
    return {options.csf,
            options.csf_table,
            options.display.distance,
            pixels_per_degree(options.display).value(),
            options.beta,
            {std::log10(std::max(static_cast<double>(*low), floor_cdm2)),
             std::log10(std::max(static_cast<double>(*high), floor_cdm2))},
            eccentricity.largest()};
}

Image as_image(const Plane& plane) {
    Image image{plane.width, plane.height, 1, {}};
    image.values.reserve(plane.values.size());
    for (const double v : plane.values) {
        image.values.push_back(static_cast<float>(std::min<double>(v, std::numeric_limits<float>::max())));
    }
    return image;
}

} // namespace

Result<Judgement> judge_modern(const Image& reference, const Image& test, const JudgeOptions& options) {
    if (auto ok = check(options); !ok) return ok.error();
    if (auto ok = check_luminance_pair("judge", reference, test); !ok) return ok.error();
    const Eccentricity eccentricity(reference, options);
    const Conditions conditions = conditions_for(reference, options, eccentricity);
    const int base = base_level(reference, conditions.ppd);

    Plane sum(reference.width, reference.height);
    for_each_band(reference, &test, base, contrast_floor(options.display), [&](const Band& band) {
        Plane powers(band.luminance.width, band.luminance.height);
        for_each_sample(band, conditions, eccentricity, true, [&](std::size_t i, double s, double mask, double change) {
            powers.values[i] = std::pow(change * s / daly_elevation(mask * s), options.beta);
        });
        spread(powers, band.level, sum, [](double& to, double from) { to += from; });
    });

    Judgement judgement;
    judgement.pixels = sum.values.size();
    for (double& v : sum.values) {
        if (v != 0) v = std::pow(v, 1 / options.beta);
        judgement.visible_pixels += !(v < 1);
        judgement.max_ratio = std::max(judgement.max_ratio, v);
    }
    judgement.visibility = as_image(sum);
    return judgement;
}

Result<Image> threshold_map_modern(const Image& reference, const JudgeOptions& options) {
    if (auto ok = check(options); !ok) return ok.error();
    if (auto ok = check_luminance("judge", reference, "reference"); !ok) return ok.error();
    const Eccentricity eccentricity(reference, options);
    const Conditions conditions = conditions_for(reference, options, eccentricity);
    const int base = base_level(reference, conditions.ppd);

    Plane threshold(reference.width, reference.height);
    std::fill(threshold.values.begin(), threshold.values.end(), std::numeric_limits<double>::infinity());
    for_each_band(reference, nullptr, base, contrast_floor(options.display), [&](const Band& band) {
        Plane steps(band.luminance.width, band.luminance.height);
        for_each_sample(band, conditions, eccentricity, false, [&](std::size_t i, double s, double mask, double) {
            steps.values[i] = band.luminance.values[i] * daly_elevation(mask * s) / s;
        });
        spread(steps, band.level, threshold, [](double& to, double from) { to = std::min(to, from); });
    });
    return as_image(threshold);
}

} // namespace unseen::perception
