// The fold test by errors in distance form: rows of a reach table for patches and for strips.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <perception/criterion.h>

#include "fold_screen.h"

namespace unseen::perception {

namespace {

using vdtree::DistanceCriterion;
using vdtree::NodeId;

// Row 0 is for what changes nothing; then contrasts (of a difference over a mean luminance) in ascending order, once for each of
// some luminances, first for patches, then for strips.
constexpr int contrasts_per_octave = 8, least_octave = -10, most_octave = 8; // 2^8: beyond any display's peak over its black
constexpr std::size_t contrast_count = contrasts_per_octave * (most_octave - least_octave) + 1;
constexpr std::size_t luminance_count = 16;
constexpr std::size_t patch_rows = 1, strip_rows = patch_rows + contrast_count * luminance_count;
constexpr std::size_t row_count = strip_rows + contrast_count * luminance_count;
constexpr double class_edge = 1e-7; // values on a class's edge stay in it; far below a class's width

// Where patterns are looked for that a strip may hold: from the lowest frequency that a table must know up to the display's limit.
constexpr double lowest_cpd = 0.5;
constexpr double frequency_step = 1.0905077326652577; // an eighth of an octave

struct Level {
    std::size_t contrast = 0, luminance = 0; // indices of classes
    bool is_nothing = true;                  // no contrast at all
};

// The larger of both in each respect.
Level above(const Level& a, const Level& b) {
    if (a.is_nothing) return b;
    if (b.is_nothing) return a;
    return {std::max(a.contrast, b.contrast), std::max(a.luminance, b.luminance), false};
}

class Levels {
public:
    explicit Levels(const Display& display)
        : black_(black_level(display).value()), span_(to_luminance(display, 1).value() - black_),
          lowest_(std::max(black_, (black_ + span_) / 4096)), // where the display is black
          log2_step_(std::log2((black_ + span_) / lowest_) / (luminance_count - 1)) {}

    double in_cdm2(double relative) const { return black_ + span_ * relative; }
    double difference_in_cdm2(double relative) const { return span_ * relative; }

    // Of a difference against a mean luminance, both in cd/m2; rounded up.
    Level level(double difference, double mean) const {
        if (!(difference > 0)) return {};
        const double base = std::max(mean, lowest_);
        return {index(contrasts_per_octave * (std::log2(difference / base) - least_octave), contrast_count),
                index(std::log2(base / lowest_) / log2_step_, luminance_count), false};
    }
    static double contrast(std::size_t level) {
        return std::exp2(least_octave + static_cast<double>(level) / contrasts_per_octave) * (1 + 2 * class_edge);
    }
    double luminance(std::size_t level) const { return lowest_ * std::exp2(log2_step_ * static_cast<double>(level)) * (1 + 2 * class_edge); }

private:
    static std::size_t index(double x, std::size_t count) {
        return static_cast<std::size_t>(std::clamp(std::ceil(x - class_edge), 0.0, static_cast<double>(count - 1)));
    }
    double black_, span_, lowest_, log2_step_;
};

std::uint16_t row(std::size_t first, const Level& level) {
    return level.is_nothing ? 0 : static_cast<std::uint16_t>(first + level.luminance * contrast_count + level.contrast);
}

// What can be seen at one luminance and eccentricity.
class Eye {
public:
    Eye(const CsfTable& csf, double eccentricity_deg, double luminance_cdm2, const Screen& screen)
        : csf_(csf), eccentricity_(eccentricity_deg), luminance_(luminance_cdm2), screen_(screen),
          limit_(csf.monotone_sensitivity(CyclesPerDegree(1 / (2 * screen.pixel_deg)), eccentricity_, luminance_)) {
        for (double low = lowest_cpd; low < 1 / (2 * screen.pixel_deg); low *= frequency_step)
            bands_.push_back({std::min(low * frequency_step, 1 / (2 * screen.pixel_deg)),
                              csf.monotone_sensitivity(CyclesPerDegree(low), eccentricity_, luminance_)});
    }

    // The distance, in radii, from which a round patch is invisible.
    double patch_reach(double contrast) const {
        const double highest_cpd = csf_.highest_visible_frequency(contrast, eccentricity_, luminance_).value();
        if (highest_cpd <= 0) return 0; // not even at the peak; only from inside
        const double extent_deg = 1 / (2 * highest_cpd);
        // Smaller than a pixel it counts by the share of the pixel that it covers.
        const double share = std::sqrt(1 / (contrast * limit_));
        const double largest_deg = extent_deg < screen_.pixel_deg ? screen_.pixel_deg * std::min(share, 1.0) : extent_deg;
        const double half = largest_deg / screen_.largest_magnification / degrees_per_radian / 2;
        return half < std::numbers::pi / 2 ? (1 + reach_rounding) / std::sin(half) : 1;
    }

    // The distance, in widths, from which a long strip is invisible.
    double strip_reach(double contrast) const {
        if (contrast * bands_.front().sensitivity <= 1) return 0;
        // For each frequency alone: contrast 2 rho w S = 1. Within a band, its highest frequency and its largest sensitivity.
        double width_deg = std::numeric_limits<double>::infinity();
        for (const Band& band : bands_)
            if (contrast * band.sensitivity > 1) width_deg = std::min(width_deg, 1 / (2 * band.highest_cpd * contrast * band.sensitivity));
        return (1 + reach_rounding) * degrees_per_radian * screen_.largest_magnification / width_deg;
    }

private:
    struct Band {
        double highest_cpd, sensitivity;
    };
    const CsfTable& csf_;
    Degrees eccentricity_;
    Luminance luminance_;
    const Screen& screen_;
    double limit_; // sensitivity at the display's limit
    std::vector<Band> bands_;
};

std::vector<float> fill_table(const std::vector<std::uint8_t>& used, std::size_t bins, const Levels& levels, const Screen& screen,
                              const CsfTable& csf) {
    std::vector<float> reach(row_count * bins, DistanceCriterion::never_visible);
    for (std::size_t luminance = 0; luminance < luminance_count; ++luminance) {
        const auto is_used = [&](std::size_t first) {
            const auto begin = used.begin() + static_cast<std::ptrdiff_t>(first + luminance * contrast_count);
            return std::find(begin, begin + contrast_count, 1) != begin + contrast_count;
        };
        if (!is_used(patch_rows) && !is_used(strip_rows)) continue;
        for (std::size_t bin = 0; bin < bins; ++bin) {
            const Eye eye(csf, static_cast<double>(bin) * degrees_per_bin, levels.luminance(luminance), screen);
            for (std::size_t contrast = 0; contrast < contrast_count; ++contrast) {
                for (const std::size_t first : {patch_rows, strip_rows}) {
                    const std::size_t at = first + luminance * contrast_count + contrast;
                    if (!used[at]) continue;
                    const double c = Levels::contrast(contrast);
                    float& value = reach[at * bins + bin];
                    value = static_cast<float>(first == patch_rows ? eye.patch_reach(c) : eye.strip_reach(c));
                    // The table's own rounding must not make anything grow with the eccentricity.
                    if (bin > 0) value = std::min(value, reach[at * bins + bin - 1]);
                }
            }
        }
    }
    return reach;
}

bool is_visible(const CsfTable& csf, const Levels& levels, const Level& level) {
    return Levels::contrast(level.contrast) * csf.peak_sensitivity(Degrees(0), Luminance(levels.luminance(level.luminance))) > 1;
}

// Of the reach of one row to that of another, at the eccentricity where it is largest; the other is seen wherever the one is.
float largest_ratio(const DistanceCriterion::Parts& parts, std::uint16_t row, std::uint16_t above) {
    float largest = 0;
    for (std::size_t bin = 0; bin < parts.eccentricity_bins; ++bin) {
        const float reach = parts.reach[row * parts.eccentricity_bins + bin];
        if (reach > 0) largest = std::max(largest, reach / parts.reach[above * parts.eccentricity_bins + bin]);
    }
    return largest;
}

} // namespace

Result<vdtree::DistanceCriterion> error_distances(const vdtree::VertexTree& tree, const vdtree::FoldErrors& errors,
                                                  const vdtree::View& view, const FoldTestOptions& options) {
    const NodeId nodes = tree.interior_count();
    const Screen screen(view, options);
    const Levels levels(options.display);
    const CsfTable& csf = options.csf ? *options.csf : CsfTable::standard();
    const double darkest = levels.in_cdm2(options.scene.darkest), brightest = levels.in_cdm2(options.scene.brightest);
    const float object_radius = tree.bounds()[vdtree::VertexTree::root()].ring.radius;

    DistanceCriterion::Parts parts;
    parts.spheres = DistanceCriterion::Spheres::ring;
    parts.eccentricity_bins = options.gaze_px ? bin_count : 1;
    parts.bin_degrees = degrees_per_bin / screen.least_magnification;
    parts.facing = errors.facing;
    parts.classes.resize(nodes);
    parts.lengths.resize(nodes);
    parts.silhouette_lengths.resize(nodes);
    std::vector<Level> patches(nodes), strips(nodes);
    std::vector<std::uint16_t> crowds(nodes, 0); // rows of what neighbours shift together
    std::vector<std::uint16_t> shifts(nodes, 0); // rows of means that shift visibly; they may do so over the whole object
    std::vector<std::uint8_t> used(row_count, 0);
    for (NodeId node = nodes; node-- > 0;) { // children before parents
        const vdtree::LuminanceRange range = tree.ring_luminance()[node];
        const double lo = levels.in_cdm2(range.lo), hi = levels.in_cdm2(range.hi), middle = (lo + hi) / 2;
        const double h = errors.distance[node], r1 = tree.bounds()[node].ring.radius;
        const double change = levels.difference_in_cdm2(errors.luminance[node]) + (hi - lo) * (r1 > 0 ? std::min(1.0, h / r1) : 1.0);
        patches[node] = above(patches[node], levels.level(change, middle));
        const Level own_shift = levels.level(levels.difference_in_cdm2(errors.shift[node]), middle);
        patches[node] = above(patches[node], own_shift);
        crowds[node] = row(strip_rows, own_shift);
        const Level shift = levels.level(levels.difference_in_cdm2(errors.mean[node]), middle);
        if (!shift.is_nothing && is_visible(csf, levels, shift)) {
            patches[node] = above(patches[node], shift);
            shifts[node] = row(patch_rows, shift);
        }
        for (const auto& [bright, dark] : {std::pair(brightest, lo), std::pair(hi, darkest)})
            strips[node] = above(strips[node], levels.level(bright - dark, (bright + dark) / 2));
        if (node == 0) break;
        const NodeId parent = tree.parents()[node];
        patches[parent] = above(patches[parent], patches[node]);
        strips[parent] = above(strips[parent], strips[node]);
    }
    for (NodeId node = 0; node < nodes; ++node) {
        parts.classes[node] = {row(patch_rows, patches[node]), row(strip_rows, strips[node])};
        used[parts.classes[node].interior] = used[parts.classes[node].silhouette] = 1;
        used[shifts[node]] = used[crowds[node]] = 1;
    }
    parts.reach = fill_table(used, parts.eccentricity_bins, levels, screen, csf);

    for (NodeId node = nodes; node-- > 0;) {
        float& length = parts.lengths[node];
        // Patches side by side, each of which shifts the mean luminance of its place, make larger ones: where their signs differ at random,
        // k times k of them one k times as wide, of 1 / k of the contrast. Largest over all k, that is what a strip of their width shows.
        const float crowd = 2 * largest_ratio(parts, crowds[node], parts.classes[node].interior);
        length = std::max(length, std::max(tree.support_spheres()[node].radius, errors.extent[node]) * std::max(1.0f, crowd));
        if (shifts[node] != 0)
            length = std::max(length, object_radius * largest_ratio(parts, shifts[node], parts.classes[node].interior));
        float& width = parts.silhouette_lengths[node];
        width = std::max(width, errors.distance[node]);
        if (node == 0) break;
        const NodeId parent = tree.parents()[node];
        parts.lengths[parent] = std::max(parts.lengths[parent], length);
        parts.silhouette_lengths[parent] = std::max(parts.silhouette_lengths[parent], width);
    }
    return DistanceCriterion::create(tree, std::move(parts));
}

} // namespace unseen::perception
