// The fold test by errors in distance form: a switch distance table for patches and for strips, and each node's rows.
#include "fold/error_distances.h"

#include <algorithm>
#include <optional>
#include <span>
#include <vector>

#include "fold/fold_screen.h"
#include "fold/shown_folds.h"
#include "fold/stage_distances.h"
#include "fold/surround.h"
#include "fold/switch_distances.h"

namespace unseen::perception {

using vdtree::DistanceCriterion;
using vdtree::NodeId;

DistanceCriterion::Parts criterion_parts(std::span<const LitErrors> as_lit, std::span<const FoldStage> measured_stages,
                                         const vdtree::View& view, const FoldTestOptions& options,
                                         const BandElevation& masking) {
    const vdtree::SoundTree& tree = *as_lit.front().tree;
    const std::span<const FoldError> errors = as_lit.front().errors;
    const NodeId nodes = tree.interior_count();
    const Screen screen(view, options);
    const PatternLevels levels(options.display);
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
    std::optional<ShownFolds> shown;
    while (!(shown = find_shown(as_lit, options, csf, screen.highest_cpd, switch_distances)))
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
        std::vector<ShownFold> stages;
        for (std::size_t first = 0; first < distances.size(); first += parts.eccentricity_bins) {
            const std::uint16_t row =
                switch_distances.add(std::span(distances).subspan(first, parts.eccentricity_bins), object_radius);
            stages.push_back({.pattern = {}, .length = object_radius, .row = row});
        }
        fold_in_stages(tree, errors, switch_distances, stages, shown->patches);
        fold_in_stages(tree, errors, switch_distances, stages, shown->strips);
    }
    for (NodeId node = 0; node < nodes; ++node) {
        parts.classes[node] = {shown->patches[node].row, shown->strips[node].row};
        parts.facing[node] = errors[node].facing;
        parts.lengths[node] = shown->patches[node].length;
        parts.silhouette_lengths[node] = shown->strips[node].length;
    }
    parts.switch_distance = switch_distances.take();
    return parts;
}

Result<DistanceCriterion> criterion_of(const vdtree::SoundTree& tree, const FoldErrors& measured,
                                       const vdtree::View& view, const FoldTestOptions& options) {
    const LitErrors own{&tree, measured.of_nodes};
    return DistanceCriterion::create(tree, criterion_parts({&own, 1}, measured.stages, view, options, {}));
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

} // namespace unseen::perception
