// The fold tests after Luebke and Hallen in distance form: a table of reaches by class and eccentricity.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <glm/geometric.hpp>

#include <perception/criterion.h>

#include "fold_screen.h"

namespace unseen::perception {

namespace {

using vdtree::DistanceCriterion;

constexpr float length_rounding = 1e-6f; // covers that of a mean of two floats

// Classes. Row 0 is for folds without any contrast; then contrasts from 2^-9 up, luminances, and shifts of the mean.
constexpr int contrasts_per_octave = 12, contrast_octaves = 9;
constexpr std::size_t contrast_count = contrasts_per_octave * contrast_octaves + 1;
constexpr std::size_t luminance_count = 16;
// Shifts of the mean, as contrasts, from 2^-9 to 2; class 0 is for none.
constexpr int shifts_per_octave = 3, shift_octaves = contrast_octaves + 1;
constexpr std::size_t shift_count = shifts_per_octave * shift_octaves + 2;
constexpr std::size_t class_count = shift_count * contrast_count * luminance_count;

// What a fold can be taken for at the worst.
struct Level {
    std::size_t contrast = 0, luminance = 0, shift = 0; // classes
    bool is_nothing = true;                             // no contrast at all

    std::size_t number() const { return (shift * luminance_count + luminance) * contrast_count + contrast; }
};

// The display's luminances and the classes that they fall into.
class Classes {
public:
    explicit Classes(const Display& display)
        : black_(black_level(display).value()), span_(to_luminance(display, 1).value() - black_),
          log2_step_(std::log2((black_ + span_) / lowest()) / (luminance_count - 1)) {}

    double in_cdm2(double relative) const { return black_ + span_ * relative; }

    // `shift`: a contrast.
    Level level(vdtree::LuminanceRange range, double adaptation, double shift = 0) const {
        const double lo = in_cdm2(range.lo), hi = in_cdm2(range.hi);
        const double contrast = (hi - lo) / (hi + lo);
        if (!(contrast > 0)) return {};
        const double c = std::ceil(contrast_octaves * contrasts_per_octave + contrasts_per_octave * std::log2(contrast) - edge);
        const double l = std::ceil(std::log2(std::max(in_cdm2(adaptation), lowest()) / lowest()) / log2_step_ - edge);
        const double s = shift > 0 ? std::ceil(contrast_octaves * shifts_per_octave + shifts_per_octave * std::log2(shift) - edge) + 1 : 0;
        const auto index = [](double x, std::size_t count) {
            return static_cast<std::size_t>(std::clamp(x, 0.0, static_cast<double>(count - 1)));
        };
        return {index(c, contrast_count), index(l, luminance_count), index(s, shift_count), false};
    }

    // Of a shift of the mean against the middle of a range.
    double shift_contrast(vdtree::LuminanceRange range, float mean_shift) const {
        return span_ * static_cast<double>(mean_shift) / std::max((in_cdm2(range.lo) + in_cdm2(range.hi)) / 2, lowest());
    }

    static double contrast(std::size_t contrast_class) {
        return std::exp2(static_cast<double>(contrast_class) / contrasts_per_octave - contrast_octaves) * (1 + 2 * edge);
    }
    static double shift(std::size_t shift_class) {
        if (shift_class == 0) return 0;
        return std::exp2(static_cast<double>(shift_class - 1) / shifts_per_octave - contrast_octaves) * (1 + 2 * edge);
    }
    double luminance(std::size_t luminance_class) const {
        return lowest() * std::exp2(log2_step_ * static_cast<double>(luminance_class)) * (1 + 2 * edge);
    }

private:
    // Values on a class's edge stay in it; far below a class's width.
    static constexpr double edge = 1e-7;
    // Where the display is black: a four-thousandth of its peak, in place of 0.
    double lowest() const { return std::max(black_, (black_ + span_) / 4096); }

    double black_, span_, log2_step_;
};

// Gives the classes in use their rows of the table, row 0 to what changes nothing.
class Rows {
public:
    std::uint16_t of(const Level& level) {
        if (level.is_nothing) return 0;
        std::uint16_t& row = row_of_[level.number()];
        if (row == 0) {
            levels_.push_back(level);
            row = static_cast<std::uint16_t>(levels_.size());
        }
        return row;
    }
    const std::vector<Level>& levels() const { return levels_; } // of row 1 and so on

private:
    std::vector<std::uint16_t> row_of_ = std::vector<std::uint16_t>(class_count, 0);
    std::vector<Level> levels_;
};
static_assert(class_count < 0xffff); // of rows

// What a class comes to at an eccentricity.
struct Visibility {
    float reach = 0;      // the distance, in lengths, at which the extent is no longer seen
    float least_cost = 0; // that of a pixel, below which nothing is drawn, and that of the shift of the mean, whatever the distance
};

// What is seen of a class's contrast at one eccentricity.
struct Seen {
    double largest_extent_deg = 0; // on the screen, that cannot be seen
    double half = 0;               // radians, before the camera: half of it
    bool is_visible = false;       // at any extent
};

Seen seen_at(float log2_frequency, const Screen& screen) {
    if (std::isinf(log2_frequency) && log2_frequency < 0) return {}; // not even at the peak; only from inside
    const double largest_extent_deg = 1 / (2 * std::exp2(static_cast<double>(log2_frequency)));
    return {largest_extent_deg, largest_extent_deg / screen.largest_magnification / degrees_per_radian / 2, true};
}

// Of extents that are the spheres' own radii.
Visibility visibility_of(const Seen& seen, const Screen& screen) {
    if (!seen.is_visible) return {};
    const double reach = seen.half < std::numbers::pi / 2 ? 1 / std::sin(seen.half) - 1 : 0;
    return {static_cast<float>(reach * (1 + reach_rounding)), static_cast<float>(screen.pixel_deg / seen.largest_extent_deg)};
}

// Of extents around the spheres, which are larger: they reach farther out towards the eye and the gaze than the spheres, from whose
// nearest points distance and eccentricity are counted.
class AroundSpheres {
public:
    AroundSpheres(const CsfTable& csf, const Screen& screen) : csf_(csf), screen_(screen) {}

    // Here and where the gaze is.
    Visibility operator()(const Seen& seen, const Seen& looked_at, double contrast, double eccentricity_deg, double luminance_cdm2) const {
        if (!looked_at.is_visible) return {};
        double largest_deg = looked_at.largest_extent_deg;
        if (eccentricity_deg > 0) {
            // What is not seen here at all may reach to where it is.
            const double bound_deg = seen.is_visible ? seen.largest_extent_deg : std::max(2 * eccentricity_deg, looked_at.largest_extent_deg);
            largest_deg = largest_extent(bound_deg, contrast, eccentricity_deg, luminance_cdm2);
        }
        const double half = largest_deg / screen_.largest_magnification / degrees_per_radian / 2;
        const double reach = half < std::numbers::pi / 2 ? 1 / std::sin(half) : 1;
        return {static_cast<float>(reach * (1 + reach_rounding)), static_cast<float>(screen_.pixel_deg / largest_deg)};
    }

private:
    // An extent is nearer to the gaze than what is counted by half of its width at most: the largest that is not seen there. Of a fixed series
    // of extents, so that more contrast never makes it larger.
    double largest_extent(double bound_deg, double contrast, double eccentricity_deg, double luminance_cdm2) const {
        const auto extent = [](int step) { return std::exp2(step / steps_per_octave); };
        const auto is_unseen = [&](int step) {
            const double nearer = std::max(0.0, eccentricity_deg - extent(step) / 2);
            return contrast * csf_.monotone_sensitivity(CyclesPerDegree(1 / (2 * extent(step))), Degrees(nearer), Luminance(luminance_cdm2)) <= 1;
        };
        int above = static_cast<int>(std::floor(steps_per_octave * std::log2(bound_deg))) + 1, below = above - 1;
        for (int stride = 1; !is_unseen(below); stride *= 2) {
            if (extent(below) < screen_.pixel_deg / smallest_of_a_pixel) return extent(below);
            above = below;
            below -= stride;
        }
        while (above - below > 1) {
            const int middle = below + (above - below) / 2;
            (is_unseen(middle) ? below : above) = middle;
        }
        return extent(below);
    }

    static constexpr double steps_per_octave = 128;
    static constexpr double smallest_of_a_pixel = 1024; // far below what any fold costs 1 at

    const CsfTable& csf_;
    const Screen& screen_;
};

void fill_table(DistanceCriterion::Parts& parts, const Rows& rows, const Classes& levels, const Screen& screen, const CsfTable& csf) {
    const std::size_t bins = parts.eccentricity_bins;
    const bool is_around_spheres = !parts.lengths.empty();
    const AroundSpheres around_spheres(csf, screen);
    parts.reach.assign((rows.levels().size() + 1) * bins, DistanceCriterion::never_visible);
    parts.least_cost.assign(parts.reach.size(), 0);
    std::array<float, bin_count> contrast, eccentricity, luminance, log2_frequency;
    for (std::size_t bin = 0; bin < bins; ++bin) eccentricity[bin] = static_cast<float>(static_cast<double>(bin) * degrees_per_bin);
    for (std::size_t i = 0; i < rows.levels().size(); ++i) {
        const Level& level = rows.levels()[i];
        float *const reach = &parts.reach[(i + 1) * bins], *const least_cost = &parts.least_cost[(i + 1) * bins];
        const double in_cdm2 = levels.luminance(level.luminance), shift = Classes::shift(level.shift);
        contrast.fill(static_cast<float>(Classes::contrast(level.contrast)));
        luminance.fill(static_cast<float>(in_cdm2));
        csf.highest_visible_log2_frequency(std::span(contrast).first(bins), std::span(eccentricity).first(bins),
                                           std::span(luminance).first(bins), std::span(log2_frequency).first(bins));
        const Seen looked_at = seen_at(log2_frequency[0], screen);
        for (std::size_t bin = 0; bin < bins; ++bin) {
            const Seen seen = seen_at(log2_frequency[bin], screen);
            const auto eccentricity_deg = static_cast<double>(eccentricity[bin]);
            Visibility here = is_around_spheres ? around_spheres(seen, looked_at, Classes::contrast(level.contrast), eccentricity_deg, in_cdm2)
                                                : visibility_of(seen, screen);
            if (shift > 0)
                here.least_cost = std::max(here.least_cost, static_cast<float>(shift * csf.peak_sensitivity(Degrees(eccentricity_deg), Luminance(in_cdm2))));
            // The table's own rounding must not make anything grow with the eccentricity.
            reach[bin] = bin == 0 ? here.reach : std::min(here.reach, reach[bin - 1]);
            least_cost[bin] = bin == 0 ? here.least_cost : std::min(here.least_cost, least_cost[bin - 1]);
        }
    }
}

DistanceCriterion::Parts parts_for(const Screen& screen, const FoldTestOptions& options) {
    DistanceCriterion::Parts parts;
    parts.spheres = DistanceCriterion::Spheres::ring;
    parts.eccentricity_bins = options.gaze_px ? bin_count : 1;
    parts.bin_degrees = degrees_per_bin / screen.least_magnification;
    return parts;
}

const CsfTable& csf_of(const FoldTestOptions& options) { return options.csf ? *options.csf : CsfTable::standard(); }

// Silhouettes may uncover anything in the scene.
vdtree::LuminanceRange outline_of(vdtree::LuminanceRange range, const SceneLuminance& scene) {
    return {std::min(range.lo, scene.darkest), std::max(range.hi, scene.brightest)};
}

float middle_of(vdtree::LuminanceRange range) { return 0.5f * (range.lo + range.hi); }

} // namespace

Result<DistanceCriterion> luebke_hallen_distances(const vdtree::VertexTree& tree, const vdtree::View& view,
                                                  const FoldTestOptions& options) {
    const Screen screen(view, options);
    const Classes levels(options.display);
    const auto ranges = tree.ring_luminance();
    const auto adaptations = tree.adaptation_luminance();

    Rows rows;
    DistanceCriterion::Parts parts = parts_for(screen, options);
    parts.classes.resize(tree.interior_count());
    for (vdtree::NodeId node = 0; node < tree.interior_count(); ++node) {
        const vdtree::LuminanceRange range = ranges[node], outline = outline_of(range, options.scene);
        const float adaptation = adaptations[node];
        parts.classes[node].interior = rows.of(levels.level(range, static_cast<double>(adaptation)));
        parts.classes[node].silhouette = rows.of(levels.level(outline, static_cast<double>(std::max(adaptation, middle_of(outline)))));
    }
    fill_table(parts, rows, levels, screen, csf_of(options));
    return DistanceCriterion::create(tree, std::move(parts));
}

Result<DistanceCriterion> luebke_hallen_safe_distances(const vdtree::VertexTree& tree, const vdtree::CutRings& rings,
                                                       const vdtree::View& view, const FoldTestOptions& options) {
    const vdtree::NodeId nodes = tree.interior_count();
    const Screen screen(view, options);
    const Classes levels(options.display);

    Rows rows;
    DistanceCriterion::Parts parts = parts_for(screen, options);
    parts.classes.resize(nodes);
    parts.lengths.resize(nodes);
    std::vector<float> adaptations(tree.adaptation_luminance().begin(), tree.adaptation_luminance().end());
    std::vector<double> shifts(nodes, 0.0); // of the mean, as contrasts
    for (vdtree::NodeId node = nodes; node-- > 0;) { // children before parents
        const vdtree::LuminanceRange range = rings.luminance[node], outline = outline_of(range, options.scene);
        const float adaptation = adaptations[node] = std::max(adaptations[node], middle_of(range));
        const double shift = shifts[node] = std::max(shifts[node], levels.shift_contrast(range, rings.mean_shift[node]));
        parts.classes[node].interior = rows.of(levels.level(range, static_cast<double>(adaptation), shift));
        parts.classes[node].silhouette = rows.of(levels.level(outline, static_cast<double>(std::max(adaptation, middle_of(outline))), shift));
        // The change is largest within the support and fades to nothing at the ring's border.
        const float around = 0.5f * (tree.support_spheres()[node].radius + rings.radius[node]) * (1 + length_rounding);
        float& length = parts.lengths[node];
        length = std::max({length, tree.bounds()[node].ring.radius, around});
        if (node == 0) break;
        const vdtree::NodeId parent = tree.parents()[node];
        adaptations[parent] = std::max(adaptations[parent], adaptation);
        shifts[parent] = std::max(shifts[parent], shift);
        parts.lengths[parent] = std::max(parts.lengths[parent], length);
    }
    fill_table(parts, rows, levels, screen, csf_of(options));
    return DistanceCriterion::create(tree, std::move(parts));
}

vdtree::Viewpoint viewpoint_of(const vdtree::VertexTree& tree, const vdtree::View& view, const FoldTestOptions& options,
                               const vdtree::Similarity& placement, bool window_only) {
    vdtree::Viewpoint viewpoint;
    viewpoint.eye = vdtree::eye_in_tree(tree, view, placement);
    if (options.gaze_px) {
        const Screen screen(view, options);
        const vdtree::CameraFrame frame = vdtree::camera_frame(view);
        const double x = (options.gaze_px->x - view.width * 0.5) * screen.pitch_over_distance / screen.scale;
        const double y = (view.height * 0.5 - options.gaze_px->y) * screen.pitch_over_distance / screen.scale;
        viewpoint.gaze = glm::normalize(placement.direction_to_mesh(x * frame.right + y * frame.up - frame.back));
    }
    if (window_only) viewpoint.frusta.push_back(vdtree::frustum_of(tree, view, placement));
    return viewpoint;
}

} // namespace unseen::perception
