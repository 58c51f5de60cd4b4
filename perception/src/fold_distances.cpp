// The perceptual fold test in distance form: a table of reaches by class and eccentricity.
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

// Classes. Row 0 is for folds without any contrast; then contrasts from `least_contrast` up, within luminances.
constexpr int contrasts_per_octave = 12, contrast_octaves = 9;
constexpr std::size_t contrast_count = contrasts_per_octave * contrast_octaves + 1;
constexpr std::size_t luminance_count = 16;
constexpr std::size_t row_count = 1 + contrast_count * luminance_count;

// The display's luminances and the classes that they fall into.
class Classes {
public:
    explicit Classes(const Display& display)
        : black_(black_level(display).value()), span_(to_luminance(display, 1).value() - black_),
          log2_step_(std::log2((black_ + span_) / lowest()) / (luminance_count - 1)) {}

    double in_cdm2(double relative) const { return black_ + span_ * relative; }

    std::uint16_t row(vdtree::LuminanceRange range, double adaptation) const {
        const double lo = in_cdm2(range.lo), hi = in_cdm2(range.hi);
        const double contrast = (hi - lo) / (hi + lo);
        if (!(contrast > 0)) return 0;
        const double c = std::ceil(contrast_octaves * contrasts_per_octave + contrasts_per_octave * std::log2(contrast) - edge);
        const double l = std::ceil(std::log2(std::max(in_cdm2(adaptation), lowest()) / lowest()) / log2_step_ - edge);
        const auto index = [](double x, std::size_t count) {
            return static_cast<std::size_t>(std::clamp(x, 0.0, static_cast<double>(count - 1)));
        };
        return static_cast<std::uint16_t>(1 + index(l, luminance_count) * contrast_count + index(c, contrast_count));
    }

    static double contrast(std::size_t row) {
        const double steps = static_cast<double>((row - 1) % contrast_count);
        return std::exp2(steps / contrasts_per_octave - contrast_octaves) * (1 + 2 * edge);
    }
    double luminance(std::size_t row) const {
        return lowest() * std::exp2(log2_step_ * static_cast<double>((row - 1) / contrast_count)) * (1 + 2 * edge);
    }

private:
    // Values on a class's edge stay in it; far below a class's width.
    static constexpr double edge = 1e-7;
    // Where the display is black: a four-thousandth of its peak, in place of 0.
    double lowest() const { return std::max(black_, (black_ + span_) / 4096); }

    double black_, span_, log2_step_;
};

// What a class comes to at an eccentricity.
struct Visibility {
    float reach = 0;      // the distance, in radii of the ring's sphere, at which the extent is no longer seen
    float least_cost = 0; // that of a pixel, below which nothing is drawn
};

Visibility visibility_of(float log2_frequency, const Screen& screen) {
    if (std::isinf(log2_frequency) && log2_frequency < 0) return {}; // not even at the peak; only from inside
    const double largest_extent_deg = 1 / (2 * std::exp2(static_cast<double>(log2_frequency)));
    const double half = largest_extent_deg / screen.largest_magnification / degrees_per_radian / 2;
    const double reach = half < std::numbers::pi / 2 ? 1 / std::sin(half) - 1 : 0;
    return {static_cast<float>(reach * (1 + reach_rounding)), static_cast<float>(screen.pixel_deg / largest_extent_deg)};
}

void fill_table(DistanceCriterion::Parts& parts, const Classes& levels, const Screen& screen, const CsfTable& csf) {
    const std::size_t bins = parts.eccentricity_bins;
    std::vector<std::uint8_t> used(row_count, 0);
    for (const vdtree::FoldClass c : parts.classes) used[c.interior] = used[c.silhouette] = 1;
    parts.reach.assign(row_count * bins, DistanceCriterion::never_visible);
    parts.least_cost.assign(row_count * bins, 0);
    std::array<float, bin_count> contrast, eccentricity, luminance, log2_frequency;
    for (std::size_t bin = 0; bin < bins; ++bin) eccentricity[bin] = static_cast<float>(static_cast<double>(bin) * degrees_per_bin);
    for (std::size_t row = 1; row < row_count; ++row) {
        if (!used[row]) continue;
        contrast.fill(static_cast<float>(Classes::contrast(row)));
        luminance.fill(static_cast<float>(levels.luminance(row)));
        csf.highest_visible_log2_frequency(std::span(contrast).first(bins), std::span(eccentricity).first(bins),
                                           std::span(luminance).first(bins), std::span(log2_frequency).first(bins));
        float *const reach = &parts.reach[row * bins], *const least_cost = &parts.least_cost[row * bins];
        for (std::size_t bin = 0; bin < bins; ++bin) {
            const Visibility here = visibility_of(log2_frequency[bin], screen);
            // The table's own rounding must not make anything grow with the eccentricity.
            reach[bin] = bin == 0 ? here.reach : std::min(here.reach, reach[bin - 1]);
            least_cost[bin] = bin == 0 ? here.least_cost : std::min(here.least_cost, least_cost[bin - 1]);
        }
    }
}

} // namespace

Result<vdtree::DistanceCriterion> luebke_hallen_distances(const vdtree::VertexTree& tree, const vdtree::View& view,
                                                          const FoldTestOptions& options) {
    const Screen screen(view, options);
    const Classes levels(options.display);
    const CsfTable& csf = options.csf ? *options.csf : CsfTable::standard();
    const auto ranges = tree.ring_luminance();
    const auto adaptations = tree.adaptation_luminance();

    DistanceCriterion::Parts parts;
    parts.spheres = DistanceCriterion::Spheres::ring;
    parts.eccentricity_bins = options.gaze_px ? bin_count : 1;
    parts.bin_degrees = degrees_per_bin / screen.least_magnification;
    parts.classes.resize(tree.interior_count());
    for (vdtree::NodeId node = 0; node < tree.interior_count(); ++node) {
        const vdtree::LuminanceRange range = ranges[node];
        // Silhouettes may uncover anything in the scene.
        const vdtree::LuminanceRange outline = {std::min(range.lo, options.scene.darkest), std::max(range.hi, options.scene.brightest)};
        const float adaptation = adaptations[node];
        parts.classes[node].interior = levels.row(range, static_cast<double>(adaptation));
        parts.classes[node].silhouette =
            levels.row(outline, static_cast<double>(std::max(adaptation, 0.5f * (outline.lo + outline.hi))));
    }
    fill_table(parts, levels, screen, csf);
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
