// What folds cost by the errors that add up in a picture.
#include <algorithm>
#include <cmath>

#include <unseen/perception/criterion.h>
#include <unseen/vdtree/internal/footprint.h>
#include <unseen/vdtree/pruning.h>

#include "fold/fold_errors.h"
#include "fold/fold_screen.h"

namespace unseen::perception {
namespace {

// The share of its own contrast by which an outline that moves to and fro errs. Observed: with 0.3 outlines take triangles
// that surfaces need more, by ColorVideoVDP and FLIP.
constexpr float outlines_share = 0.03f;
// A fold whose surface shifts by more than this share of its radius does not bend it but makes it vanish, all of it where
// that is half of the radius.
constexpr float least_vanishing = 0.15f, all_vanishes = 0.5f;
// Thresholds for a root of squared relative luminance times square degrees a triangle. Observed: for closed meshes, near
// and far, the largest cost that a budget leaves is then about the same by either order, from 2% to 50% of the triangles.
constexpr double thresholds = 1.9e4;

float square(float x) { return x * x; }

} // namespace

Result<std::vector<float>> summed_costs(const vdtree::VertexTree& of, const vdtree::ShownParts& shown,
                                        const vdtree::View& view, const vdtree::Similarity& placement,
                                        const FoldTestOptions& options) {
    if (const auto valid = check_arguments(view, options); !valid) return valid.error();
    if (const auto valid = vdtree::validate_perspective(view, "What adds up in a picture"); !valid)
        return valid.error();
    const auto tree = vdtree::SoundTree::of(of);
    if (!tree) return tree.error();
    if (const auto measured = fold_errors_of(*tree, options.model); !measured) return measured.error();
    const vdtree::NodeId nodes = tree->interior_count();
    if (shown.area.size() != nodes || shown.outline.size() != nodes)
        return invalid_argument("What a picture shows is not of this tree.");
    const auto records = tree->attribute<FoldRecord>(record_name);
    const auto weights = tree->fold_weights();
    const double focal_px = view.height / (2 * std::tan(view.fov_y_degrees * std::numbers::pi / 360));
    const glm::dvec3 eye = vdtree::eye_in_tree(*tree, view, placement);
    const vdtree::LuminanceRange behind =
        options.scene.behind.value_or(vdtree::LuminanceRange{options.scene.darkest, options.scene.brightest});
    std::vector<float> errors(nodes);
    for (vdtree::NodeId node = 0; node < nodes; ++node) {
        const FoldRecord& record = records[node];
        const vdtree::Sphere& support = tree->support_spheres()[node];
        const vdtree::LuminanceRange range = tree->ring_luminance()[node];
        const double distance = glm::length(glm::dvec3(support.centre) - eye);
        // In a sphere around the eye nothing folds.
        const float shift_px = distance > 0 ? record.shift * static_cast<float>(focal_px / distance) : 0.0f;
        const float middle = (range.lo + range.hi) / 2,
                    step = std::max(std::abs(middle - behind.lo), std::abs(behind.hi - middle));
        const float of_radius = support.radius > 0 ? record.shift / support.radius : 1.0f;
        const float vanishes = std::clamp((of_radius - least_vanishing) / (all_vanishes - least_vanishing), 0.0f, 1.0f);
        const float error = shown.area[node] * (square(record.mean_luminance) + vanishes * square(step)) +
                            std::max(outlines_share, vanishes) * square(step) * shift_px * shown.outline[node];
        errors[node] = std::min(error * (weights.size() > 1 ? square(weights[node]) : 1.0f), 1e30f);
    }
    auto costs = vdtree::pruning_prices(*tree, errors);
    if (!costs) return costs;
    const double of_pixels = thresholds / pixels_per_degree(options.display).value();
    for (float& cost : *costs) cost = static_cast<float>(of_pixels * std::sqrt(static_cast<double>(cost)));
    return costs;
}

} // namespace unseen::perception
