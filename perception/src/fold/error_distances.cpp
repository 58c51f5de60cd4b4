// The fold test by errors in distance form: rows of a switch distance table for patches and for strips.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <vector>

#include <glm/geometric.hpp>

#include <unseen/perception/shadow_edges.h>
#include <unseen/vdtree/internal/light_bounds.h>

#include "fold/error_distances.h"
#include "fold/fold_screen.h"
#include "fold/luminance_classes.h"
#include "fold/pooling.h"
#include "fold/stage_distances.h"
#include "fold/surround.h"

namespace unseen::perception {

namespace {

using vdtree::DistanceCriterion;
using vdtree::NodeId;

// Of a difference over a mean luminance, in classes up to 2^8: beyond any display's peak over its black.
constexpr int contrasts_per_octave = 8;
constexpr ClassSeries contrasts{contrasts_per_octave, -10, 18};
constexpr int contrast_count = static_cast<int>(contrasts.count()) - 1; // without no_contrast
constexpr int no_contrast = -1;
constexpr int luminance_count = static_cast<int>(LuminanceClasses::count);

// Of the frequencies at which patterns are looked for that a strip may hold, from the lowest one up to the display's
// limit.
constexpr double frequency_step = 1.0905077326652577; // an eighth of an octave

// Octaves of contrast that a small part of a patch may have over all of it: sharper ones count as this, a sixteenth of
// the width. They are rare, and each octave is more rows.
constexpr int steepest_spike = 8 * contrasts_per_octave;

// An outline that moves by such a share of the mesh's radius is that of a part, which vanishes as a whole.
constexpr float whole_part = 0.125f;

// The widest mesh there can be, in widths of a node: also where nodes have none.
constexpr float widest = 1e9f;

class Levels {
public:
    explicit Levels(const Display& display) : luminances_(display) {}

    double in_cdm2(double relative) const { return luminances_.in_cdm2(relative); }
    double difference_in_cdm2(double relative) const { return luminances_.difference_in_cdm2(relative); }

    // Of a contrast, and of a luminance in cd/m2.
    int contrast_level(double difference, double base) const {
        return static_cast<int>(contrasts.of(difference / std::max(base, luminances_.lowest()))) - 1;
    }
    int luminance_level(double base) const { return static_cast<int>(luminances_.of(base)); }
    static double contrast(int level) { return contrasts.value(static_cast<std::size_t>(level + 1)); }
    double luminance(int level) const { return luminances_.value(static_cast<std::size_t>(level)); }

private:
    LuminanceClasses luminances_;
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

    auto operator<=>(const Pattern&) const = default;
    bool is_nothing() const { return largest == no_contrast && bias == no_contrast; }
};

// At least as visible as both.
Pattern above(const Pattern& a, const Pattern& b) {
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
Pattern rounded(Pattern p, int coarseness) {
    constexpr int coarsest_fading = 32; // on coarser grids bias does not fade at all, which is above any that does
    const int typical_step = coarseness * contrasts_per_octave / 8, spike_step = coarseness * contrasts_per_octave / 4;
    const int bias_step = coarseness * contrasts_per_octave / 8;
    const auto up = [](int value, int step) { return std::min((value + step - 1) / step * step, contrast_count - 1); };
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

// Of patterns, from far below any width that can be seen up to the lowest frequency's.
constexpr double widest_deg = 1 / lowest_table_cpd, width_step = 0.91700404320467122; // an eighth of an octave
constexpr std::size_t width_count = 184;
double width_deg(std::size_t i) { return widest_deg * std::pow(width_step, static_cast<double>(i)); }

// What bands of frequency see of patterns of all widths, as shares of their contrast: of this, eyes that see patterns
// at all luminances and eccentricities have one copy.
struct Bands {
    using Shares = std::vector<double>; // [width * bands + band]

    std::vector<double> lowest_cpd; // by band
    Shares of_patches, of_areas, of_strips;

    // `summation`: of CsfSamples.
    Bands(double highest_cpd, const FoldModel& model, double summation) {
        for (double low = lowest_table_cpd; low < highest_cpd; low *= frequency_step) lowest_cpd.push_back(low);
        for (std::size_t i = 0; i < width_count; ++i) {
            const double width = width_deg(i);
            const SquareDegrees area = disc(width), neighbourhood = disc(width * model.neighbourhood);
            for (const double low : lowest_cpd) {
                const double high = std::min(low * frequency_step, highest_cpd), waves = width * high;
                const CyclesPerDegree cpd(high);
                of_patches.push_back(share_of_patches(waves, model.most_side_by_side) *
                                     summation_gain(cpd, neighbourhood, summation));
                of_areas.push_back(share_of_area(waves) * summation_gain(cpd, area, summation));
                of_strips.push_back(std::min(1.0, waves)); // half as wide
            }
        }
    }
};

// By how many octaves the mean light around a pattern of one luminance is less than its own: [width * bands + band], as
// Bands. A band looks at a neighbourhood as wide as its wave, of which the mesh lights no more than it covers of the
// pattern's own. Empty where nothing darker is behind.
struct Dimming {
    std::vector<float> of_patches, of_areas;
    std::size_t most = 0; // octaves

    Dimming(const Bands& bands, const Surround& surround, double luminance_cdm2, double highest_cpd,
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

// What can be seen at one luminance and eccentricity. Bands of frequency an octave apart look for a pattern; what they
// see of it is pooled as the eye pools its channels; wherever the bands' octaves begin.
class Eye {
public:
    Eye(const CsfTable& csf, double eccentricity_deg, double luminance_cdm2, const Screen& screen, const Bands& bands,
        const Dimming& dimming, const BandElevation& masking, const FoldModel& model)
        : screen_(screen), model_(model) {
        // To contrasts over the pattern's own luminance, by octaves that the mean around it is less: [octaves][band].
        Sensitivities sensitivities(dimming.most + 1);
        for (std::size_t octaves = 0; octaves <= dimming.most; ++octaves)
            for (std::size_t band = 0; band < bands.lowest_cpd.size(); ++band) {
                const double less = std::exp2(static_cast<double>(octaves));
                const double cpd = bands.lowest_cpd[band];
                const double here = less / masking.at(cpd) *
                                    csf.monotone_sensitivity(CyclesPerDegree(cpd), Degrees(eccentricity_deg),
                                                             Luminance(luminance_cdm2 / less));
                sensitivities[octaves].push_back(octaves > 0 ? std::max(here, sensitivities[octaves - 1][band]) : here);
            }
        const double needed = needed_sensitivity(model, Degrees(eccentricity_deg));
        for (std::size_t i = 0; i < width_count; ++i) {
            patches_[i] = 1 / (needed * visibility(sensitivities, bands.of_patches, dimming.of_patches, i));
            areas_[i] = 1 / (model.needed_by_areas * visibility(sensitivities, bands.of_areas, dimming.of_areas, i));
            strips_[i] = 1 / visibility(sensitivities, bands.of_strips, {}, i);
        }
    }

    // The distances, in radii, from which a round patch among others like it is invisible, and an area on its own.
    double patch_distance(double contrast) const { return switch_distance(patches_, contrast); }
    double area_distance(double contrast) const { return switch_distance(areas_, contrast); }

    // The distance, in widths, from which a long strip is invisible.
    double strip_distance(double contrast, Course course) const {
        const double needed = course == Course::to_and_fro ? model_.needed_by_outlines
                              : course == Course::as_made  ? model_.needed_by_borders
                                                           : 1;
        const double invisible_deg = 0.5 * least_visible_width(strips_, contrast * needed);
        if (!std::isfinite(invisible_deg)) return 0;
        const double counted_deg =
            std::max(invisible_deg - model_.sampled_shift_px * screen_.pixel_deg, invisible_deg / 2);
        return (1 + distance_rounding) * degrees_per_radian * screen_.largest_magnification / counted_deg;
    }

private:
    static constexpr std::size_t bands_per_octave = 8;
    using Thresholds = std::array<double, width_count>; // contrasts, by width
    using Sensitivities = std::vector<std::vector<double>>;

    // Of unit contrast, in thresholds. `dimmed`: octaves, as Dimming has them; empty: none.
    static double visibility(const Sensitivities& sensitivities, const Bands::Shares& shares,
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

// The switch distance of patterns by eccentricity, computed when they are first asked for. Where patterns are too many
// for the rows' numbers, begin again with coarser ones.
class SwitchDistances {
public:
    // `added`: rows that add() will ask for.
    SwitchDistances(const Levels& levels, const Screen& screen, const CsfTable& csf, const FoldModel& model,
                    const Surround& surround, const BandElevation& masking, std::size_t bins, std::size_t added)
        : levels_(levels), screen_(screen), csf_(csf), model_(model), surround_(surround), masking_(masking),
          bands_(screen.highest_cpd, model, csf.samples().summation), bins_(bins), most_patterns_(last_row - added),
          discs_(luminance_count), eyes_(luminance_count) {
        begin();
    }

    std::uint16_t row(const Pattern& pattern) { // simplified; 0 where there is none left
        if (pattern.is_nothing()) return 0;
        if (const auto known = rows_.find(pattern); known != rows_.end()) return known->second;
        if (rows_.size() == most_patterns_) {
            has_too_few_ = true;
            return 0;
        }
        const auto row = static_cast<std::uint16_t>(rows_.size() + 1);
        rows_.emplace(pattern, row);
        pattern.is_strip ? add_strip(pattern) : add_patch(pattern);
        return row;
    }
    bool has_too_few() const { return has_too_few_; } // of what there is, nothing is to be used then
    // Forgets all rows. Ends well: at a coarseness of 256 each contrast is one of two, and there are no more than 16
    // luminances, 121 quarters and four ways to combine a typical and a largest contrast: 16,000 patches.
    void coarsen() {
        coarseness_ *= 2;
        begin();
    }
    // On the grid, and without bias that can nowhere be seen from as far as the rest.
    Pattern simplified(Pattern p) {
        p = rounded(p, coarseness_);
        if (p.bias == no_contrast || p.typical == no_contrast) return p;
        const Discs& tables = discs(p.luminance);
        const float* const typical = &tables.patches[static_cast<std::size_t>(p.typical) * bins_];
        bool is_needed = false;
        for_each_bias(p, [&](int contrast, float width) {
            const float* const from = &tables.areas[static_cast<std::size_t>(contrast) * bins_];
            for (std::size_t bin = 0; bin < bins_; ++bin) is_needed |= width * from[bin] > typical[bin];
        });
        if (is_needed) return p;
        p.bias = no_contrast;
        return rounded(p, coarseness_);
    }
    // A row of distances, in lengths of its own.
    std::uint16_t add(std::span<const float> distances, float length) {
        for (const float distance : distances)
            switch_distance_.push_back(std::min(distance / length, DistanceCriterion::always_visible));
        return static_cast<std::uint16_t>(switch_distance_.size() / bins_ - 1);
    }
    std::span<const float> switch_distance(std::uint16_t row) const {
        return std::span(switch_distance_).subspan(row * bins_, bins_);
    }
    std::vector<float> take() { return std::move(switch_distance_); }

private:
    static constexpr std::size_t last_row = std::numeric_limits<std::uint16_t>::max();

    void begin() {
        rows_.clear();
        switch_distance_.assign(bins_, DistanceCriterion::never_visible); // row 0: what changes nothing
        has_too_few_ = false;
    }

    const Eye& eye(int luminance, std::size_t bin) {
        auto& eyes = eyes_[static_cast<std::size_t>(luminance)];
        if (eyes.empty()) {
            const double cdm2 = levels_.luminance(luminance);
            const Dimming dimming(bands_, surround_, cdm2, screen_.highest_cpd, model_);
            for (std::size_t b = 0; b < bins_; ++b)
                eyes.emplace_back(csf_, static_cast<double>(b) * degrees_per_bin, cdm2, screen_, bands_, dimming,
                                  masking_, model_);
        }
        return eyes[bin];
    }

    struct Discs {
        std::vector<float> patches, areas; // [contrast * bins + bin], in radii
    };
    const Discs& discs(int luminance) {
        Discs& tables = discs_[static_cast<std::size_t>(luminance)];
        if (tables.patches.empty()) {
            for (int contrast = 0; contrast < contrast_count; ++contrast) {
                for (std::size_t bin = 0; bin < bins_; ++bin) {
                    tables.patches.push_back(
                        static_cast<float>(eye(luminance, bin).patch_distance(Levels::contrast(contrast))));
                    tables.areas.push_back(
                        static_cast<float>(eye(luminance, bin).area_distance(Levels::contrast(contrast))));
                }
            }
        }
        return tables;
    }

    void add_patch(const Pattern& p) {
        const std::size_t first = switch_distance_.size();
        switch_distance_.resize(first + bins_, 0);
        const Discs& tables = discs(p.luminance);
        const auto include = [&](const std::vector<float>& one, int contrast, float width) {
            const float* const from = &one[static_cast<std::size_t>(contrast) * bins_];
            for (std::size_t bin = 0; bin < bins_; ++bin)
                switch_distance_[first + bin] = std::max(switch_distance_[first + bin], width * from[bin]);
        };
        if (p.typical != no_contrast) {
            // The same light in a part half as wide has four times the contrast; but nowhere more than the largest.
            constexpr int per_halving = 2 * contrasts_per_octave;
            float width = 1;
            for (int contrast = std::min(p.typical, p.largest);;
                 contrast = std::min(contrast + per_halving, p.largest), width /= 2) {
                include(tables.patches, contrast, width);
                if (contrast == p.largest) break;
            }
        }
        if (p.bias != no_contrast)
            for_each_bias(p, [&](int contrast, float width) { include(tables.areas, contrast, width); });
        make_monotone(first);
    }

    // Calls f(contrast, width) for the mesh and for areas down to twice the node's width, at whole octaves.
    template <class F>
    static void for_each_bias(const Pattern& p, F&& f) {
        for (int quarters = p.quarters; quarters >= 4; quarters = (quarters - 1) / 4 * 4) {
            const int contrast = p.bias - (quarters * p.fading * contrasts_per_octave / 2 + 3) / 4;
            if (contrast >= 0) f(contrast, std::exp2(static_cast<float>(quarters) / 4));
        }
    }

    void add_strip(const Pattern& p) {
        const std::size_t first = switch_distance_.size();
        for (std::size_t bin = 0; bin < bins_; ++bin)
            switch_distance_.push_back(
                static_cast<float>(eye(p.luminance, bin).strip_distance(Levels::contrast(p.largest), p.course)));
        make_monotone(first);
    }

    // The table's own rounding must not make anything grow with the eccentricity.
    void make_monotone(std::size_t first) {
        for (std::size_t i = first + 1; i < switch_distance_.size(); ++i)
            switch_distance_[i] = std::min(switch_distance_[i], switch_distance_[i - 1]);
    }

    const Levels& levels_;
    const Screen& screen_;
    const CsfTable& csf_;
    const FoldModel& model_;
    const Surround surround_;
    const BandElevation& masking_;
    const Bands bands_;
    std::size_t bins_, most_patterns_;
    int coarseness_ = 1;
    bool has_too_few_ = false;
    std::vector<Discs> discs_;
    std::vector<std::vector<Eye>> eyes_; // by luminance; by bin
    std::map<Pattern, std::uint16_t> rows_;
    std::vector<float> switch_distance_;
};

// A pattern of a width, and what it comes to.
struct Shown {
    Pattern pattern;
    float length = 0;
    std::uint16_t row = 0;
};

// By how much the one must be wider to be seen from as far as the other everywhere.
float shortfall(const SwitchDistances& switch_distances, const Shown& a, const Shown& b) {
    constexpr float infinity = std::numeric_limits<float>::infinity();
    if (b.row == 0) return 1;
    if (a.row == b.row) return a.length > 0 ? std::max(b.length / a.length, 1.0f) : b.length > 0 ? infinity : 1;
    const std::span<const float> of_a = switch_distances.switch_distance(a.row),
                                 of_b = switch_distances.switch_distance(b.row);
    float factor = 0;
    for (std::size_t bin = 0; bin < of_a.size(); ++bin) {
        if (!(of_b[bin] > 0)) continue;
        if (!(of_a[bin] > 0)) return infinity;
        factor = std::max(factor, b.length > 0 ? b.length * of_b[bin] / (a.length * of_a[bin]) : 0.0f);
    }
    constexpr float rounding = 4e-6f; // of the products, when the criterion is checked
    return std::max(factor * (1 + rounding), 1.0f);
}

// From how far it is seen, in all.
float weight(const SwitchDistances& switch_distances, const Shown& shown) {
    float sum = 0;
    const std::span<const float> switch_distance = switch_distances.switch_distance(shown.row);
    for (std::size_t bin = 0; bin < switch_distance.size(); bin += 8)
        sum += std::log2(1 + std::max(switch_distance[bin], 0.0f) * shown.length);
    return sum;
}

// Makes `a` be seen from as far as `b`: wider, or of more contrast, whichever adds less.
void cover(SwitchDistances& switch_distances, Shown& a, const Shown& b) {
    if (a.row == 0) {
        if (b.row != 0) a = {b.pattern, std::max(a.length, b.length), b.row};
        return;
    }
    if (a.row == b.row) a.length = std::max(a.length, b.length);
    const float factor = shortfall(switch_distances, a, b);
    if (factor <= 1) return;
    Shown wider = a, richer = a;
    wider.length *= factor;
    richer.pattern = above(a.pattern, b.pattern);
    richer.length = std::max(a.length, b.length);
    richer.row = switch_distances.row(richer.pattern);
    // Biases of different widths are told at different octaves.
    richer.length *= std::max(shortfall(switch_distances, richer, a), shortfall(switch_distances, richer, b));
    if (!std::isfinite(wider.length) && !std::isfinite(richer.length)) {
        richer.pattern.fading = 0; // then the larger bias is above both everywhere
        richer.length = std::max(a.length, b.length);
        richer.row = switch_distances.row(richer.pattern);
    }
    const bool is_wider_less =
        !std::isfinite(richer.length) || weight(switch_distances, wider) <= weight(switch_distances, richer);
    a = std::isfinite(wider.length) && is_wider_less ? wider : richer;
}

// Of a textured tree: by how much the light of a ring's vertices differs where the texture is brightest. What is moved of
// the texture is measured.
double spread_of_vertices(const vdtree::SoundTree& tree, NodeId node) {
    constexpr float least_texture = 1.0f / 64; // that tells the vertices' luminance well
    const vdtree::LuminanceRange drawn = tree.ring_luminance()[node], texture = tree.ring_texture()[node];
    if (!(texture.hi > 0)) return 0;
    const NodeId around = node > 0 ? tree.parents()[node] : node;
    const float darkest = texture.lo >= least_texture ? drawn.lo / texture.lo
                                                      : vdtree::LuminanceRange(tree.support_luminance()[around]).lo;
    return static_cast<double>(std::max(drawn.hi - darkest * texture.hi, 0.0f));
}

// What nodes show, no less than their children: patches, and strips where they are outlines. Of several trees, which
// are one under different lights, whatever shows more. False where the rows do not suffice.
bool find_shown(std::span<const LitErrors> as_lit, const FoldTestOptions& options, const Levels& levels,
                const CsfTable& csf, double highest_cpd, SwitchDistances& switch_distances, std::vector<Shown>& patches,
                std::vector<Shown>& strips) {
    const vdtree::SoundTree& tree = *as_lit.front().tree; // what does not depend on the light is the same in all
    const double darkest = levels.in_cdm2(options.scene.darkest), brightest = levels.in_cdm2(options.scene.brightest);
    const float object_radius = tree.support_spheres()[vdtree::VertexTree::root()].radius;
    const vdtree::LuminanceRange all = tree.ring_luminance()[vdtree::VertexTree::root()];
    const int whole = levels.luminance_level(levels.in_cdm2(static_cast<double>(all.lo + all.hi) / 2));
    const double whole_peak = csf.peak_sensitivity(Degrees(0), Luminance(levels.luminance(whole))) *
                              summation_gain(CyclesPerDegree(highest_cpd), disc(180), csf.samples().summation);
    patches.assign(tree.interior_count(), {});
    strips.assign(tree.interior_count(), {});
    const bool textured = !tree.texture().empty();
    const auto patch_of = [&](const LitErrors& lit, NodeId node) {
        const std::span<const FoldError> errors = lit.errors;
        const vdtree::LuminanceRange range = lit.tree->ring_luminance()[node];
        const double lo = levels.in_cdm2(range.lo), hi = levels.in_cdm2(range.hi), middle = (lo + hi) / 2;
        const double r1 = tree.bounds()[node].ring.radius;
        const double edge = levels.difference_in_cdm2(lit.edge_of_shadow(node)),
                     moved = std::max(
                         textured ? levels.difference_in_cdm2(spread_of_vertices(*lit.tree, node)) : hi - lo, edge);
        const auto change = [&](float luminance, double distance) {
            if (tree.bounds()[node].flags & vdtree::translucent_ring)
                return brightest - darkest; // anything may show through
            return levels.difference_in_cdm2(luminance) + moved * (r1 > 0 ? std::min(1.0, distance / r1) : 1.0);
        };
        Shown patch;
        patch.pattern.luminance = levels.luminance_level(middle);
        patch.pattern.largest = levels.contrast_level(change(errors[node].luminance, errors[node].distance), middle);
        const int typical = levels.contrast_level(
            change(errors[node].wide_luminance, options.model.amplitude_of_shift_mean * errors[node].mean_distance),
            middle);
        if (patch.pattern.largest != no_contrast)
            patch.pattern.typical =
                std::clamp(typical, std::max(patch.pattern.largest - steepest_spike, 0), patch.pattern.largest);
        patch.length = std::max(tree.support_spheres()[node].radius, errors[node].extent);
        const int bias = levels.contrast_level(static_cast<double>(errors[node].bias), 1);
        if (bias != no_contrast && Levels::contrast(bias) * whole_peak > 1) {
            patch.pattern.luminance = std::max(patch.pattern.luminance, whole);
            patch.pattern.bias = bias, patch.pattern.fading = errors[node].fading;
            patch.pattern.quarters = static_cast<int>(
                std::ceil(4 * std::log2(std::max(std::min(widest, object_radius / patch.length), 1.0f))));
        }
        patch.pattern = switch_distances.simplified(patch.pattern);
        patch.row = switch_distances.row(patch.pattern);
        return patch;
    };
    const auto strip_of = [&](const LitErrors& lit, NodeId node) {
        const std::span<const FoldError> errors = lit.errors;
        const vdtree::LuminanceRange range = lit.tree->ring_luminance()[node];
        const double lo = levels.in_cdm2(range.lo), hi = levels.in_cdm2(range.hi);
        Shown strip;
        for (const auto& [bright, dark] : {std::pair(brightest, lo), std::pair(hi, darkest)}) {
            const double mean = (bright + dark) / 2;
            const Pattern own{.luminance = levels.luminance_level(mean),
                              .largest = levels.contrast_level(bright - dark, mean),
                              .is_strip = true};
            strip.pattern = above(strip.pattern, own);
        }
        strip.length = errors[node].outline;
        strip.pattern.course = strip.length >= whole_part * object_radius           ? Course::one_way
                               : tree.bounds()[node].flags & vdtree::irregular_ring ? Course::as_made
                                                                                    : Course::to_and_fro;
        strip.row = switch_distances.row(strip.pattern);
        return strip;
    };
    for (NodeId node = tree.interior_count(); node-- > 0;) { // children before parents
        Shown patch = patch_of(as_lit.front(), node), strip = strip_of(as_lit.front(), node);
        for (const LitErrors& lit : as_lit.subspan(1)) {
            cover(switch_distances, patch, patch_of(lit, node));
            cover(switch_distances, strip, strip_of(lit, node));
        }
        cover(switch_distances, patch, patches[node]); // the children's
        patches[node] = patch;
        cover(switch_distances, strip, strips[node]);
        strips[node] = strip;
        if (node > 0) {
            const NodeId parent = tree.parents()[node];
            cover(switch_distances, patches[parent], patch);
            cover(switch_distances, strips[parent], strip);
        }
        if (switch_distances.has_too_few()) return false;
    }
    return true;
}

// A node folds as well where the whole mesh does, as far as the node's stage: takes the stage where that is nowhere
// seen from farther, unless a child would then be. Children before parents.
void fold_in_stages(const vdtree::SoundTree& tree, std::span<const FoldError> errors,
                    const SwitchDistances& switch_distances, std::span<const Shown> stages, std::span<Shown> shown) {
    std::vector<bool> may_take(shown.size(), true);
    for (std::size_t node = shown.size(); node-- > 0;) {
        const std::size_t number = errors[node].stage;
        if (may_take[node] && shortfall(switch_distances, shown[node], stages[number]) <= 1) {
            shown[node] = stages[number]; // no more than the parent's own, nor its stage
            continue;
        }
        if (node == 0) return;
        const NodeId parent = tree.parents()[node];
        const std::size_t above = errors[parent].stage;
        if (!(shortfall(switch_distances, stages[above], shown[node]) <= 1)) may_take[parent] = false;
    }
}

} // namespace

double LitErrors::edge_of_shadow(NodeId node) const {
    double sum = 0;
    for (const vdtree::LightSource& light : casting) {
        double most = light.intensity;
        if (light.kind != vdtree::LightSource::Kind::directional) {
            const vdtree::Sphere ring = tree->bounds()[node].ring;
            const double nearest =
                glm::length(light.position - glm::dvec3(ring.centre)) - static_cast<double>(ring.radius);
            most = nearest > 0 ? most * (light.distance / nearest) * (light.distance / nearest) : 1;
        }
        sum += most;
    }
    return std::min(sum * largest_albedo, 1.0); // luminances end there
}

DistanceCriterion::Parts criterion_parts(std::span<const LitErrors> as_lit, std::span<const FoldStage> measured_stages,
                                         const vdtree::View& view, const FoldTestOptions& options,
                                         const BandElevation& masking) {
    const vdtree::SoundTree& tree = *as_lit.front().tree;
    const std::span<const FoldError> errors = as_lit.front().errors;
    const NodeId nodes = tree.interior_count();
    const Screen screen(view, options);
    const Levels levels(options.display);
    const CsfTable& csf = csf_of(options);

    DistanceCriterion::Parts parts;
    parts.spheres = DistanceCriterion::Spheres::ring;
    parts.eccentricity_bins = options.gaze_px ? bin_count : 1;
    parts.bin_degrees = degrees_per_bin / screen.least_magnification;
    parts.facing.resize(nodes);
    parts.classes.resize(nodes);
    parts.lengths.resize(nodes);
    parts.silhouette_lengths.resize(nodes);
    const float object_radius = tree.support_spheres()[vdtree::VertexTree::root()].radius;
    const Surround surround = surround_of(tree, options);
    SwitchDistances switch_distances(levels, screen, csf, options.model, surround, masking, parts.eccentricity_bins,
                                     measured_stages.size());
    std::vector<Shown> patches, strips;
    while (!find_shown(as_lit, options, levels, csf, screen.highest_cpd, switch_distances, patches, strips))
        switch_distances.coarsen();
    // The edge of a shadow on the mesh moves with the surface as its outline would before what is in the shadow.
    FoldTestOptions behind = options;
    const bool has_edges = std::ranges::any_of(as_lit, [](const LitErrors& lit) { return !lit.casting.empty(); });
    if (behind.scene.behind && has_edges)
        for (const LitErrors& lit : as_lit) {
            const vdtree::LuminanceRange own = lit.tree->luminance_range();
            behind.scene.behind->lo = std::min(behind.scene.behind->lo, own.lo);
            behind.scene.behind->hi = std::max(behind.scene.behind->hi, own.hi);
        }
    const std::vector<float> distances =
        stage_distances(tree, measured_stages, screen, behind, masking, parts.eccentricity_bins);
    if (!distances.empty() && object_radius > 0) {
        std::vector<Shown> stages;
        for (std::size_t first = 0; first < distances.size(); first += parts.eccentricity_bins) {
            const std::uint16_t row =
                switch_distances.add(std::span(distances).subspan(first, parts.eccentricity_bins), object_radius);
            stages.push_back({.pattern = {}, .length = object_radius, .row = row});
        }
        fold_in_stages(tree, errors, switch_distances, stages, patches);
        fold_in_stages(tree, errors, switch_distances, stages, strips);
    }
    for (NodeId node = 0; node < nodes; ++node) {
        parts.classes[node] = {patches[node].row, strips[node].row};
        parts.facing[node] = errors[node].facing;
        parts.lengths[node] = patches[node].length;
        parts.silhouette_lengths[node] = strips[node].length;
    }
    parts.switch_distance = switch_distances.take();
    return parts;
}

Result<DistanceCriterion> criterion_of(const vdtree::SoundTree& tree, const FoldErrors& measured,
                                       const vdtree::View& view, const FoldTestOptions& options) {
    const LitErrors own{&tree, measured.of_nodes};
    return DistanceCriterion::create(tree, criterion_parts({&own, 1}, measured.stages, view, options, {}));
}

double needed_sensitivity(const FoldModel& model, Degrees eccentricity) {
    const auto& at = FoldModel::needed_at_degrees;
    const double e = std::clamp(eccentricity.value(), at.front(), at.back());
    std::size_t i = 0;
    while (i + 2 < at.size() && e > at[i + 1]) ++i;
    return std::lerp(model.needed[i], model.needed[i + 1], (e - at[i]) / (at[i + 1] - at[i]));
}

Result<void> validate(const FoldModel& m) {
    for (const double factor :
         {m.neighbourhood, m.needed_by_areas, m.needed_by_outlines, m.needed_by_borders, m.peak_of_shift,
          m.moved_by_neighbours, m.contact_reach, m.least_sine, m.sampled_shift_px, m.amplitude_of_point_mean,
          m.amplitude_of_shift_mean, m.longest_ring, m.between_directions, m.contrast_of_textures})
        if (!(factor >= 0 && std::isfinite(factor)))
            return Error{ErrorCode::invalid_argument, "fold test: the model's factors must be finite, and 0 or more"};
    for (std::size_t i = 0; i < m.needed.size(); ++i)
        if (!(m.needed[i] > 0 && m.needed[i] <= (i > 0 ? m.needed[i - 1] : 1e3)))
            return Error{ErrorCode::invalid_argument, "fold test: the sensitivity needed, model.needed[" +
                                                          std::to_string(i) +
                                                          "], must be above 0 and not rise with the eccentricity"};
    if (m.neighbourhood == 0 || m.needed_by_areas == 0 || m.needed_by_outlines == 0 || m.needed_by_borders == 0)
        return Error{ErrorCode::invalid_argument, "fold test: the model's neighbourhood, needed_by_areas, "
                                                  "needed_by_outlines and needed_by_borders must be above 0"};
    if (m.most_side_by_side < 1 || m.most_side_by_side > FoldModel::largest_side_by_side)
        return Error{ErrorCode::invalid_argument, "fold test: the model's most_side_by_side must be from 1 to 64"};
    return {};
}

Result<DistanceCriterion> error_distances(const vdtree::VertexTree& tree, const vdtree::View& view,
                                          const FoldTestOptions& options) {
    if (const auto valid = check_arguments(view, options); !valid) return valid.error();
    if (const auto valid = validate(options.model); !valid) return valid.error();
    const auto sound = vdtree::SoundTree::of(tree);
    if (!sound) return sound.error();
    const auto errors = fold_errors_of(*sound, options.model);
    if (!errors) return errors.error();
    return criterion_of(*sound, *errors, view, options);
}

Result<DistanceCriterion> error_distances(std::span<const TreeAsLit> as_lit, const vdtree::View& view,
                                          const FoldTestOptions& options) {
    if (const auto valid = check_arguments(view, options); !valid) return valid.error();
    if (const auto valid = validate(options.model); !valid) return valid.error();
    const auto trees = LitTrees::of(as_lit, options.model);
    if (!trees) return trees.error();
    return DistanceCriterion::create(trees->tree(),
                                     criterion_parts(trees->as_lit(), trees->stages(), view, options, {}));
}

Result<LitTrees> LitTrees::of(std::span<const TreeAsLit> trees, const FoldModel& model) {
    if (trees.empty()) return Error{ErrorCode::invalid_argument, "fold test: there is no tree under lights to look at"};
    double albedo = 0;
    const vdtree::VertexTree& first = trees.front().tree;
    for (NodeId node = 0; node < first.node_count(); ++node)
        albedo = std::max(albedo, static_cast<double>(vdtree::albedo_of(first, node)));
    LitTrees all;
    all.sound_.reserve(trees.size()), all.errors_.reserve(trees.size()); // they are referred to
    for (const TreeAsLit& one : trees) {
        if (one.tree.interior_count() != first.interior_count())
            return Error{ErrorCode::invalid_argument, "fold test: the trees under lights are not of one tree"};
        auto tree = vdtree::SoundTree::of(one.tree);
        if (!tree) return tree.error();
        all.sound_.push_back(std::move(*tree));
        auto measured = fold_errors_of(all.sound_.back(), model);
        if (!measured) return measured.error();
        all.errors_.push_back(std::move(*measured));
        all.lit_.push_back({&all.sound_.back(), all.errors_.back().of_nodes, {}, albedo});
        for (const vdtree::LightSource& light : one.lighting.lights)
            if (light.casts_shadow) all.lit_.back().casting.push_back(light);
    }
    // Parts of the mesh may be lit in either way: no contrast is larger than the larger one of both (LitStages).
    const std::span<const FoldStage> own = all.errors_.front().stages;
    all.stages_.assign(own.begin(), own.end());
    for (const FoldErrors& errors : all.errors_) {
        if (errors.stages.size() != own.size()) all.stages_.clear(); // somewhere no light is left
        for (std::size_t i = 0; i < all.stages_.size(); ++i) include(errors.stages[i], all.stages_[i]);
    }
    return all;
}

namespace {

// Of illuminances from a four-thousandth of white to white; more light than that is cut off.
constexpr int illuminance_octaves = 12, illuminances_per_octave = 4;
double illuminance_at(int i) {
    return std::exp2(static_cast<double>(i) / illuminances_per_octave - illuminance_octaves);
}

} // namespace

Result<ShadowEdges> ShadowEdges::create(const vdtree::View& view, const FoldTestOptions& options, double ambient) {
    if (const auto valid = check_arguments(view, options); !valid) return valid.error();
    if (const auto valid = validate(options.model); !valid) return valid.error();
    if (!(ambient >= 0 && ambient <= 1))
        return Error{ErrorCode::invalid_argument, "fold test: the ambient light must be from 0 to 1"};
    const Screen screen(view, options);
    const Levels levels(options.display);
    const CsfTable& csf = csf_of(options);
    const Bands bands(screen.highest_cpd, options.model, csf.samples().summation);
    std::map<int, Eye> eyes; // by luminance
    // Strips that are lit by `own`, whatever the angle: all that is below the illuminance occurs.
    std::vector<double> widest_strips;
    double least = std::numeric_limits<double>::infinity();
    for (int i = 0; i <= illuminance_octaves * illuminances_per_octave; ++i) {
        const double own = illuminance_at(i), before = i > 0 ? illuminance_at(i - 1) : 0;
        const double mean = levels.in_cdm2(ambient + own / 2);
        const int luminance = levels.luminance_level(mean);
        auto eye = eyes.find(luminance);
        if (eye == eyes.end()) {
            const double cdm2 = levels.luminance(luminance);
            const Surround none{cdm2, 1}; // strips are not dimmed
            const Dimming dimming(bands, none, cdm2, screen.highest_cpd, options.model);
            eye = eyes.emplace(luminance, Eye(csf, 0, cdm2, screen, bands, dimming, {}, options.model)).first;
        }
        const int contrast = levels.contrast_level(levels.difference_in_cdm2(own), mean);
        const double needed_widths =
            contrast == no_contrast ? 0 : eye->second.strip_distance(Levels::contrast(contrast), Course::one_way);
        // Between the last one's light and this one's, the widest is no less than this. Below the first, taken as there.
        const double from = i > 0 ? before : own;
        if (needed_widths > 0) least = std::min(least, from / needed_widths);
        widest_strips.push_back(least);
    }
    return ShadowEdges(std::move(widest_strips));
}

double ShadowEdges::widest_unseen(double illuminance) const {
    if (!(illuminance > 0)) return illuminance <= 0 ? std::numeric_limits<double>::infinity() : 0;
    const double place = std::ceil((std::log2(illuminance) + illuminance_octaves) * illuminances_per_octave);
    const double last = static_cast<double>(widest_.size() - 1);
    return widest_[static_cast<std::size_t>(std::clamp(place, 0.0, last))] / illuminance;
}

} // namespace unseen::perception
