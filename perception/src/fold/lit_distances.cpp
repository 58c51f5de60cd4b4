// The fold test under lights in distance form: a table of switch distances for every class of contrast, luminance and
// eccentricity.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>

#include <perception/criterion.h>
#include <vdtree/internal/contrast_classes.h>

#include "fold/fold_screen.h"

namespace unseen::perception {

namespace {

using vdtree::ContrastClasses;
using vdtree::DistanceCriterion;

// In cd/m2.
vdtree::AbsoluteScale scale_of(const Display& display) {
    const double black = black_level(display).value();
    return {.offset = black, .span = to_luminance(display, 1).value() - black};
}

// What a class comes to at an eccentricity.
struct Visibility {
    float switch_distance = 0; // the distance, in radii of the ring's sphere, at which the extent is no longer seen
    float least_cost = 0;      // that of a pixel, below which nothing is drawn
};

Visibility visibility_of(float log2_frequency, const Screen& screen) {
    if (std::isinf(log2_frequency) && log2_frequency < 0) return {}; // not even at the peak; only from inside
    const double largest_extent_deg = 1 / (2 * std::exp2(static_cast<double>(log2_frequency)));
    const double half = largest_extent_deg / screen.largest_magnification / degrees_per_radian / 2;
    const double switch_distance = half < std::numbers::pi / 2 ? 1 / std::sin(half) - 1 : 0;
    return {static_cast<float>(switch_distance * (1 + distance_rounding)),
            static_cast<float>(screen.pixel_deg / largest_extent_deg)};
}

void fill_table(DistanceCriterion::Parts& parts, const ContrastClasses& classes, const Screen& screen,
                const CsfTable& csf) {
    const std::size_t bins = parts.eccentricity_bins;
    parts.switch_distance.assign(ContrastClasses::class_count * bins, DistanceCriterion::never_visible);
    parts.least_cost.assign(ContrastClasses::class_count * bins, 0);
    std::array<float, bin_count> contrast, eccentricity, luminance, log2_frequency;
    for (std::size_t bin = 0; bin < bins; ++bin)
        eccentricity[bin] = static_cast<float>(static_cast<double>(bin) * degrees_per_bin);
    for (std::size_t number = 1; number < ContrastClasses::class_count; ++number) {
        contrast.fill(static_cast<float>(ContrastClasses::contrast(number)));
        luminance.fill(static_cast<float>(classes.level(number)));
        csf.highest_visible_log2_frequency(std::span(contrast).first(bins), std::span(eccentricity).first(bins),
                                           std::span(luminance).first(bins), std::span(log2_frequency).first(bins));
        float* const switch_distance = &parts.switch_distance[number * bins];
        float* const least_cost = &parts.least_cost[number * bins];
        for (std::size_t bin = 0; bin < bins; ++bin) {
            const Visibility here = visibility_of(log2_frequency[bin], screen);
            // The table's own rounding must not make anything grow with the eccentricity.
            switch_distance[bin] =
                bin == 0 ? here.switch_distance : std::min(here.switch_distance, switch_distance[bin - 1]);
            least_cost[bin] = bin == 0 ? here.least_cost : std::min(here.least_cost, least_cost[bin - 1]);
        }
    }
}

// Nothing falls with the contrast or the luminance; the table's own rounding must not make it.
void make_growing(DistanceCriterion::Parts& parts) {
    const std::size_t bins = parts.eccentricity_bins;
    const auto raise = [&](std::size_t number, std::size_t to) {
        for (std::vector<float>* values : {&parts.switch_distance, &parts.least_cost})
            for (std::size_t bin = 0; bin < bins; ++bin) {
                float& value = (*values)[number * bins + bin];
                value = std::max(value, (*values)[to * bins + bin]);
            }
    };
    for (std::size_t l = 0; l < ContrastClasses::level_count; ++l)
        for (std::size_t c = 0; c < ContrastClasses::contrast_count; ++c) {
            if (c > 0) raise(ContrastClasses::class_at(l, c), ContrastClasses::class_at(l, c - 1));
            if (l > 0) raise(ContrastClasses::class_at(l, c), ContrastClasses::class_at(l - 1, c));
        }
}

} // namespace

Result<vdtree::DistanceCriterion> lit_distances(const vdtree::VertexTree& tree,
                                                std::shared_ptr<const vdtree::LightBounds> bounds,
                                                const vdtree::View& view, const FoldTestOptions& options) {
    if (const auto sound = check_arguments(view, options); !sound) return sound.error();
    const Screen screen(view, options);
    const vdtree::AbsoluteScale scale = scale_of(options.display);
    const ContrastClasses classes(scale);
    const SceneLuminance scene = options.scene;
    DistanceCriterion::Parts parts;
    parts.spheres = DistanceCriterion::Spheres::ring;
    parts.eccentricity_bins = options.gaze_px ? bin_count : 1;
    parts.bin_degrees = degrees_per_bin / screen.least_magnification;
    parts.lit =
        vdtree::LitClasses{std::move(bounds), scale,
                           classes.class_of({scene.darkest, scene.brightest}, static_cast<double>(scene.brightest))};
    fill_table(parts, classes, screen, csf_of(options));
    make_growing(parts);
    return DistanceCriterion::create(tree, std::move(parts));
}

SceneLuminance lit_scene(const vdtree::VertexTree& tree, const vdtree::LightBounds& bounds,
                         const vdtree::Lighting& lighting, glm::dvec3 eye, float background) {
    const vdtree::NodeId root = vdtree::VertexTree::root();
    const vdtree::LuminanceRange range =
        vdtree::lit_range(lighting, bounds.cones()[root], tree.bounds()[root].ring, eye);
    constexpr float steps = 32;
    return {std::floor(steps * std::min(range.lo, background)) / steps,
            std::ceil(steps * std::max(range.hi, background)) / steps};
}

} // namespace unseen::perception
