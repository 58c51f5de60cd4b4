// The fold test under lights in distance form: a table of switch distances for every class of contrast, luminance and
// eccentricity.

#include <unseen/vdtree/internal/light_bounds.h>

#include "fold/largest_extents.h"
#include "fold/luminance_classes.h"

namespace unseen::perception {

namespace {

using vdtree::ContrastClasses;
using vdtree::DistanceCriterion;

void fill_table(DistanceCriterion::Parts& parts, const ContrastClasses& classes, const Screen& screen,
                const CsfTable& csf) {
    const std::size_t bins = parts.eccentricity_bins;
    parts.switch_distance.assign(ContrastClasses::class_count * bins, DistanceCriterion::never_visible);
    parts.least_cost.assign(ContrastClasses::class_count * bins, 0);
    std::vector<double> extents(bins);
    for (std::size_t number = 1; number < ContrastClasses::class_count; ++number) {
        const double contrast = ContrastClasses::contrast(number), luminance_cdm2 = classes.level(number);
        if (parts.lengths.empty()) {
            find_grey_extents(contrast, luminance_cdm2, csf, degrees_per_bin, extents);
        } else {
            const auto visibility = [&](double frequency, double eccentricity) {
                return contrast * csf.monotone_sensitivity(CyclesPerDegree(frequency), Degrees(eccentricity),
                                                           Luminance(luminance_cdm2));
            };
            LargestExtents largest(visibility, screen, true);
            for (std::size_t bin = 0; bin < bins; ++bin)
                extents[bin] = largest.at(static_cast<double>(bin) * degrees_per_bin);
        }
        set_row(parts, number, extents, screen, [](std::size_t) { return 0.0; });
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

Result<DistanceCriterion> make_criterion(const vdtree::VertexTree& tree, DistanceCriterion::Parts parts,
                                         std::shared_ptr<const vdtree::LightBounds> bounds, const CsfTable& csf,
                                         const vdtree::View& view, const FoldTestOptions& options) {
    const Screen screen(view, options);
    const vdtree::AbsoluteScale scale = LuminanceClasses(options.display).scale();
    const ContrastClasses classes(scale);
    const SceneLuminance scene = options.scene;
    parts.spheres = DistanceCriterion::Spheres::ring;
    parts.eccentricity_bins = options.gaze_px ? bin_count : 1;
    parts.bin_degrees = degrees_per_bin / screen.least_magnification;
    parts.lit =
        vdtree::LitClasses{std::move(bounds), scale,
                           classes.class_of({scene.darkest, scene.brightest}, static_cast<double>(scene.brightest))};
    fill_table(parts, classes, screen, csf);
    make_growing(parts);
    return DistanceCriterion::create(tree, std::move(parts));
}

} // namespace

Result<DistanceCriterion> lit_distances(const vdtree::VertexTree& tree,
                                        std::shared_ptr<const vdtree::LightBounds> bounds, const vdtree::View& view,
                                        const FoldTestOptions& options) {
    if (const auto valid = check_arguments(view, options); !valid) return valid.error();
    return make_criterion(tree, {}, std::move(bounds), csf_of(options), view, options);
}

Result<DistanceCriterion> lit_safe_distances(const vdtree::VertexTree& tree, const CutRings& rings,
                                             std::shared_ptr<const vdtree::LightBounds> bounds,
                                             const vdtree::View& view, const FoldTestOptions& options) {
    if (const auto valid = check_arguments(view, options); !valid) return valid.error();
    const auto sound = vdtree::SoundTree::of(tree);
    if (!sound) return sound.error();
    if (rings.radius.size() != tree.interior_count() || !bounds || bounds->radii().size() != tree.interior_count())
        return invalid_argument(
            "The rings, or what lights make of them (bound_lit_cut_rings()), are not those of the tree.");
    DistanceCriterion::Parts parts;
    parts.lengths = safe_lengths(*sound, rings);
    parts.facing = safe_facing(tree, rings);
    return make_criterion(tree, std::move(parts), std::move(bounds), csf_of(options).of_half_waves(), view, options);
}

SceneLuminance lit_scene(const vdtree::VertexTree& tree, const vdtree::LightBounds& bounds,
                         const vdtree::Lighting& lighting, glm::dvec3 eye, float background) {
    const vdtree::NodeId root = vdtree::VertexTree::root();
    const vdtree::LuminanceRange range =
        vdtree::lit_range(lighting, bounds.cones()[root], bounds.sphere(tree, root), eye);
    constexpr float steps = 32;
    return {std::floor(steps * std::min(range.lo, background)) / steps,
            std::ceil(steps * std::max(range.hi, background)) / steps};
}

} // namespace unseen::perception
