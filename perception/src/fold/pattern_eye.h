// What a fold shows, in classes, and from how far such patterns are invisible to an eye at one luminance and eccentricity.
#pragma once

#include <memory>
#include <mutex>

#include "fold/fold_factors.h"
#include "fold/fold_screen.h"
#include "fold/luminance_classes.h"

namespace unseen::perception {

// Differences over a mean luminance, in classes up to 2^8: beyond any display's peak over its black. They begin far below
// what is seen of a pattern that fills the view, for they are rounded up: else the least difference of a fold of long
// triangles would be one that is seen.
inline constexpr int pattern_contrasts_per_octave = 8;
inline constexpr ClassSeries pattern_contrasts{pattern_contrasts_per_octave, -16, 24};
inline constexpr int pattern_contrast_count = static_cast<int>(pattern_contrasts.count()) - 1; // without no_contrast
inline constexpr int no_contrast = -1;
inline constexpr int pattern_luminance_count = static_cast<int>(LuminanceClasses::count);

// Luminances and contrasts on a display, and their classes.
class PatternLevels : public LuminanceClasses {
public:
    using LuminanceClasses::LuminanceClasses;

    // For a contrast and a luminance in cd/m2.
    int contrast_level(double difference, double base) const {
        return static_cast<int>(pattern_contrasts.of(difference / std::max(base, lowest()))) - 1;
    }
    int luminance_level(double base) const { return static_cast<int>(of(base)); }
    static double contrast(int level) { return pattern_contrasts.value(static_cast<std::size_t>(level + 1)); }
    double luminance(int level) const { return value(static_cast<std::size_t>(level)); }
};

// How a strip shifts along its length; what is later is seen better.
enum class Course {
    to_and_fro, // an outline of a surface
    as_made,    // an open border, which may be as regular as holes in a grid
    one_way     // of a part that vanishes
};

// What a node's fold shows, as far as that decides from where it can be seen: levels of contrast at widths relative to
// the node's.
struct Pattern {
    int luminance = 0;
    int typical = no_contrast;    // over the whole width
    int largest = no_contrast;    // in a small part of it
    int bias = no_contrast;       // of what many such nodes shift together
    int fading = 0, quarters = 0; // of octaves, from the node's width to the mesh's
    bool is_strip = false;
    Course course = Course::to_and_fro; // of strips

    bool operator==(const Pattern&) const = default;
    bool is_nothing() const { return largest == no_contrast && bias == no_contrast; }
};
struct PatternHash {
    std::size_t operator()(const Pattern& p) const noexcept {
        std::uint64_t bits = 0;
        for (const int value : {p.luminance, p.typical, p.largest, p.bias, p.fading, p.quarters,
                                static_cast<int>(p.is_strip), static_cast<int>(p.course)})
            bits = (bits ^ static_cast<std::uint32_t>(value)) * 0x9e3779b97f4a7c15u;
        return static_cast<std::size_t>(bits ^ (bits >> 32));
    }
};

// At least as visible as both.
inline Pattern above(const Pattern& a, const Pattern& b) {
    if (a.is_nothing()) return b;
    if (b.is_nothing()) return a;
    Pattern all{std::max(a.luminance, b.luminance),
                std::max(a.typical, b.typical),
                std::max(a.largest, b.largest),
                std::max(a.bias, b.bias),
                0,
                std::max(a.quarters, b.quarters),
                a.is_strip,
                std::max(a.course, b.course)};
    all.fading = a.bias == no_contrast ? b.fading : b.bias == no_contrast ? a.fading : std::min(a.fading, b.fading);
    return all;
}

// Few patterns are to stand for many: rounded up, onto one grid, so that what is above two of them is there, too.
// `coarseness`: of the grid, 1 or a power of two.
inline Pattern rounded(Pattern p, int coarseness) {
    constexpr int coarsest_fading = 32; // on coarser grids bias does not fade at all, which is above any that does
    const int typical_step = coarseness * pattern_contrasts_per_octave / 8,
              spike_step = coarseness * pattern_contrasts_per_octave / 4;
    const int bias_step = coarseness * pattern_contrasts_per_octave / 8;
    const auto up = [](int value, int step) {
        return std::min((value + step - 1) / step * step, pattern_contrast_count - 1);
    };
    if (p.typical != no_contrast) {
        p.typical = up(p.typical, typical_step);
        p.largest = p.largest > p.typical ? up(p.largest, spike_step) : p.typical;
    }
    if (p.bias != no_contrast) {
        p.bias = up(p.bias, bias_step);
        if (coarseness > coarsest_fading) p.fading = 0;
    } else {
        p.fading = p.quarters = 0;
    }
    return p;
}

// The step between the frequencies at which a strip's patterns are looked for, from the lowest one up to the display's
// limit.
inline constexpr double frequency_step = 1.0905077326652577; // an eighth of an octave

// The widths of patterns, from far below any that can be seen up to the lowest frequency's.
inline constexpr double widest_deg = 1 / lowest_table_cpd, width_step = 0.91700404320467122; // an eighth of an octave
inline constexpr std::size_t width_count = 184;
inline double width_deg(std::size_t i) { return widest_deg * std::pow(width_step, static_cast<double>(i)); }

// What bands of frequency see of patterns of all widths, as shares of their contrast: of this, eyes that see patterns
// at all luminances and eccentricities have one copy.
struct PatternBands {
    using Shares = std::vector<double>; // [width * bands + band]

    std::vector<double> lowest_cpd; // by band
    Shares of_patches, of_areas, of_strips;

    // `summation`: of CsfSamples.
    PatternBands(double highest_cpd, const FoldModel& model, double summation) {
        for (double low = lowest_table_cpd; low < highest_cpd; low *= frequency_step) lowest_cpd.push_back(low);
        for (std::size_t i = 0; i < width_count; ++i) {
            const double width = width_deg(i);
            const SquareDegrees area = disc(width), neighbourhood = disc(width * model.neighbourhood);
            for (const double low : lowest_cpd) {
                const double high = std::min(low * frequency_step, highest_cpd), waves = width * high;
                const CyclesPerDegree cpd(high);
                of_patches.push_back(share_of_patches(waves, factors::most_side_by_side) *
                                     summation_gain(cpd, neighbourhood, summation));
                of_areas.push_back(share_of_area(waves) * summation_gain(cpd, area, summation));
                of_strips.push_back(std::min(1.0, waves)); // half as wide
            }
        }
    }
};

// The same once for all trees that are looked at in one way, one after the other: making them takes as long as measuring a
// hundred nodes.
inline std::shared_ptr<const PatternBands> pattern_bands(double highest_cpd, const FoldModel& model, double summation) {
    struct Last {
        std::mutex mutex;
        double highest_cpd = 0, summation = 0;
        FoldModel model;
        std::shared_ptr<const PatternBands> bands;
    };
    static Last last;
    const std::lock_guard lock(last.mutex);
    if (!last.bands || last.highest_cpd != highest_cpd || last.summation != summation || !(last.model == model)) {
        last.bands = std::make_shared<const PatternBands>(highest_cpd, model, summation);
        last.highest_cpd = highest_cpd, last.summation = summation, last.model = model;
    }
    return last.bands;
}

// By how many octaves the mean light around a pattern of one luminance is less than its own: [width * bands + band], as
// PatternBands. A band looks at a neighbourhood as wide as its wave, of which the mesh lights no more than it covers of
// the pattern's own. Empty where nothing darker is behind.
struct Dimming {
    std::vector<float> of_patches, of_areas;
    std::size_t most = 0; // octaves

    Dimming(const PatternBands& bands, const Surround& surround, double luminance_cdm2, double highest_cpd,
            const FoldModel& model) {
        const double dark = std::max(surround.darkest_cdm2, luminance_cdm2 * std::exp2(-most_dimming));
        if (!(dark < luminance_cdm2)) return;
        const auto octaves_below = [&](double waves) {
            const double mean = std::max(dark, surround.mean_cdm2(luminance_cdm2, waves * waves));
            return static_cast<float>(std::log2(luminance_cdm2 / mean));
        };
        for (std::size_t i = 0; i < width_count; ++i)
            for (const double low : bands.lowest_cpd) {
                const double waves = width_deg(i) * std::min(low * frequency_step, highest_cpd);
                of_patches.push_back(octaves_below(waves * model.neighbourhood));
                of_areas.push_back(octaves_below(waves));
            }
        most = static_cast<std::size_t>(std::ceil(std::log2(luminance_cdm2 / dark)));
    }
    static constexpr double most_dimming = 12; // octaves; beyond, the eye's own noise is the limit
};

// What can be seen at one luminance and eccentricity. PatternBands of frequency an octave apart look for a pattern;
// what they see of it is pooled as the eye pools its channels; wherever the bands' octaves begin.
class PatternEye {
public:
    PatternEye(const CsfTable& csf, double eccentricity_deg, double luminance_cdm2, const Screen& screen,
               const PatternBands& bands, const Dimming& dimming, const FoldModel& model)
        : screen_(screen), model_(model) {
        // To contrasts over the pattern's own luminance, by octaves that the mean around it is less: [octaves][band].
        Sensitivities sensitivities(dimming.most + 1);
        for (std::size_t octaves = 0; octaves <= dimming.most; ++octaves)
            for (std::size_t band = 0; band < bands.lowest_cpd.size(); ++band) {
                const double less = std::exp2(static_cast<double>(octaves));
                const double cpd = bands.lowest_cpd[band];
                const double here = less * csf.monotone_sensitivity(CyclesPerDegree(cpd), Degrees(eccentricity_deg),
                                                                    Luminance(luminance_cdm2 / less));
                sensitivities[octaves].push_back(octaves > 0 ? std::max(here, sensitivities[octaves - 1][band]) : here);
            }
        const double needed = needed_sensitivity(model, Degrees(eccentricity_deg));
        for (std::size_t i = 0; i < width_count; ++i) {
            patches_[i] = 1 / (needed * visibility(sensitivities, bands.of_patches, dimming.of_patches, i));
            areas_[i] = 1 / (factors::needed_by_areas * visibility(sensitivities, bands.of_areas, dimming.of_areas, i));
            strips_[i] = 1 / visibility(sensitivities, bands.of_strips, {}, i);
        }
    }

    // The distances, in radii, from which a round patch among others like it is invisible, and an area on its own.
    double patch_distance(double contrast) const { return switch_distance(patches_, contrast); }
    double area_distance(double contrast) const { return switch_distance(areas_, contrast); }

    // The distance, in widths, from which a long strip is invisible.
    double strip_distance(double contrast, Course course) const {
        const double needed = course == Course::to_and_fro ? model_.needed_by_outlines
                              : course == Course::as_made  ? factors::needed_by_borders
                                                           : 1;
        const double invisible_deg = 0.5 * least_visible_width(strips_, contrast * needed);
        if (!std::isfinite(invisible_deg)) return 0;
        const double counted_deg =
            std::max(invisible_deg - factors::sampled_shift_px * screen_.pixel_deg, invisible_deg / 2);
        return (1 + distance_rounding) * degrees_per_radian * screen_.largest_magnification / counted_deg;
    }

private:
    static constexpr std::size_t bands_per_octave = 8;
    using Thresholds = std::array<double, width_count>; // contrasts, by width
    using Sensitivities = std::vector<std::vector<double>>;

    // The visibility of unit contrast, in thresholds. `dimmed`: octaves, as Dimming has them; empty: not dimmed.
    static double visibility(const Sensitivities& sensitivities, const PatternBands::Shares& shares,
                             std::span<const float> dimmed, std::size_t width) {
        const std::size_t bands = sensitivities.front().size();
        const double* const share = shares.data() + width * bands;
        std::array<double, bands_per_octave> sums{}; // by where the octaves begin
        for (std::size_t i = 0; i < bands; ++i) {
            double sensitivity = sensitivities[0][i];
            if (!dimmed.empty() && dimmed[width * bands + i] > 0) {
                const double octaves = static_cast<double>(dimmed[width * bands + i]);
                const auto whole = std::min(static_cast<std::size_t>(octaves), sensitivities.size() - 2);
                sensitivity = std::lerp(sensitivities[whole][i], sensitivities[whole + 1][i],
                                        octaves - static_cast<double>(whole));
            }
            sums[i % bands_per_octave] += to_power_of_pooling(share[i] * sensitivity);
        }
        return std::pow(*std::max_element(sums.begin(), sums.end()), 1 / pooling);
    }

    double switch_distance(const Thresholds& thresholds, double contrast) const {
        const double invisible_deg = least_visible_width(thresholds, contrast);
        if (!std::isfinite(invisible_deg)) return 0; // from inside only
        const double half = invisible_deg / screen_.largest_magnification / degrees_per_radian / 2;
        return half < std::numbers::pi / 2 ? (1 + distance_rounding) / std::sin(half) : 1;
    }

    // The widest that is invisible; infinite where all are.
    static double least_visible_width(const Thresholds& thresholds, double contrast) {
        // Thresholds rise as widths fall.
        const auto first = std::lower_bound(thresholds.begin(), thresholds.end(), contrast);
        if (first == thresholds.begin()) return std::numeric_limits<double>::infinity();
        if (first == thresholds.end()) return width_deg(width_count - 1);
        const auto above = static_cast<std::size_t>(first - thresholds.begin());
        const double t0 = thresholds[above - 1], t1 = thresholds[above]; // visible, invisible
        const double share = t1 > t0 ? std::log(contrast / t0) / std::log(t1 / t0) : 1;
        return widest_deg * std::pow(width_step, static_cast<double>(above - 1) + share);
    }

    const Screen& screen_;
    const FoldModel& model_;
    Thresholds patches_, areas_, strips_;
};

} // namespace unseen::perception
