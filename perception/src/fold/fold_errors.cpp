#include "fold/fold_errors.h"

#include <glm/geometric.hpp>

#include <unseen/perception/internal/chroma.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/light_bounds.h>

#include "fold/fold_factors.h"
#include "measure/measure_folds.h"
#include "measure/pyramid.h"

namespace unseen::perception {

using namespace vdtree;

namespace {

using Amplitudes = decltype(FoldRecord::amplitudes);

// What waves see of a patch, `waves` of theirs wide, of one grating's amplitude: of patches side by side, and of its
// parts half as wide, four times the amplitude.
float share_in_wave(float waves) {
    return waves >= 1 ? std::exp2(2 * std::floor(std::log2(waves)))
                      : share_of_patches(waves, factors::most_side_by_side);
}

struct BandShares {
    Amplitudes of_wave; // by picture and band

    BandShares() {
        for (std::size_t size = 0; size < measurement::picture_sizes.size(); ++size)
            for (std::size_t band = 0; band < measurement::picture_bands; ++band)
                of_wave[size][band] =
                    share_in_wave(measurement::picture_side * static_cast<float>(nominal_frequency(band)) /
                                  measurement::picture_sizes[size]);
    }
};

void find_luminance(const FoldRecord& record, const BandShares& shares, FoldError& error) {
    for (std::size_t size = 0; size < measurement::picture_sizes.size(); ++size)
        for (std::size_t band = 0; band < measurement::picture_bands; ++band) {
            const float amplitude = record.amplitudes[size][band];
            error.luminance = std::max(error.luminance, amplitude);
            error.wide_luminance = std::max(error.wide_luminance, amplitude / shares.of_wave[size][band]);
        }
    error.luminance = std::max(error.luminance, error.wide_luminance);
}

// Detail is of parts of the patch, as many octaves narrower as its waves are.
void find_texture(const FoldTexture& texture, LuminanceRange drawn, FoldError& error) {
    const float middle = (drawn.lo + drawn.hi) / 2 + FoldStage::black; // that a criterion divides by
    for (std::size_t octaves = 0; octaves < texture_octaves; ++octaves) {
        const float amplitude = texture.contrast[octaves] * middle;
        error.luminance = std::max(error.luminance, amplitude);
        error.wide_luminance = std::max(error.wide_luminance, amplitude * std::exp2(-2 * static_cast<float>(octaves)));
    }
}

Error refused(const std::string& what) {
    return {ErrorCode::malformed_data, "The measurement of the tree's folds is damaged: " + what +
                                           " Measure it again, or build the tree again from its mesh."};
}

} // namespace

std::vector<FoldError> nested_errors(const SoundTree& tree, std::span<const FoldRecord> records,
                                     std::span<const FoldFacing> facing, std::span<const FoldTexture> textures,
                                     const FoldModel& model) {
    const BandShares shares;
    const auto contact_reach = static_cast<float>(model.contact_reach),
               least_sine = static_cast<float>(model.least_sine);
    std::vector<FoldError> errors(records.size());
    for (NodeId node = tree.interior_count(); node-- > 0;) { // children before parents
        const FoldRecord& record = records[node];
        FoldError& error = errors[node]; // it has the children's distance, extent and directions
        const float ring = tree.bounds()[node].ring.radius,
                    width = std::max(tree.support_spheres()[node].radius, record.extent);
        const float shift = factors::peak_of_shift * record.shift,
                    moved_point = factors::moved_by_neighbours * record.farthest;
        error.mean_distance = record.mean_distance;
        find_luminance(record, shares, error);
        const bool is_shown = facing[node].is_height_field != 0 && ring <= factors::longest_ring * width;
        if (is_shown) {
            error.distance = std::max({error.distance, shift, record.mean_distance});
            if (record.thickness > 0) {
                error.thickness = record.thickness;
                error.thin_luminance = factors::amplitude_of_point_mean * record.mean_luminance;
            }
        } else { // something may be under what was drawn, or beside it
            error.distance = std::max({error.distance, shift, moved_point});
            error.luminance = std::max(error.luminance, record.largest_luminance);
            error.wide_luminance =
                std::max(error.wide_luminance, factors::amplitude_of_point_mean * record.mean_luminance);
        }
        if (!textures.empty()) {
            find_texture(textures[node], tree.ring_luminance()[node], error);
            error.luminance *= factors::contrast_of_textures, error.wide_luminance *= factors::contrast_of_textures;
        }
        error.extent = std::max(error.extent, record.extent);
        error.border = std::max(error.border, record.border);
        error.facing |= facing[node].facing;
        error.bias = record.bias, error.fading = facing[node].fading;
        // Where parts meet, a fold moves the line along which the one hides the other, like an outline, whatever they
        // face: the farther, the flatter they meet. That is nothing that a mean over cells would tell.
        const float moved = std::max(error.distance, moved_point);
        if (moved > 0 && record.gap < contact_reach * moved) {
            error.facing = NormalSlabs::everything();
            error.distance = std::max(moved, std::min(moved / std::max(record.sine, least_sine), ring));
        }
        error.outline = std::max({error.outline, error.distance, error.border});
        if (node == 0) break;
        FoldError& parent = errors[tree.parents()[node]];
        parent.distance = std::max(parent.distance, error.distance);
        parent.border = std::max(parent.border, error.border);
        parent.outline = std::max(parent.outline, error.outline);
        parent.extent = std::max(parent.extent, error.extent);
        parent.facing |= error.facing;
    }
    return errors;
}

Result<FoldErrors> fold_errors_of(const SoundTree& tree, const FoldModel& model) {
    const auto records = tree.attribute<FoldRecord>(record_name);
    const auto facing = tree.attribute<FoldFacing>(facing_name);
    const auto stage_of = tree.attribute<std::uint8_t>(stage_of_name);
    const auto settings = tree.attribute<float>(settings_name);
    const auto textures = tree.attribute<FoldTexture>(texture_name);
    if (records.empty())
        return invalid_argument(Message::of(
            "The errors of the tree's folds are not measured: measure them with {perception::measure_folds()}."));
    if (!std::ranges::equal(settings, measurement::settings))
        return unsupported(
            Message::of("The tree's folds were measured with other settings than this program knows: measure them "
                        "again with {perception::measure_folds()}."));
    const std::size_t nodes = tree.interior_count();
    if (records.size() != nodes || facing.size() != nodes || stage_of.size() != nodes ||
        textures.size() != (has_detail(tree) ? nodes : 0))
        return refused("a part of it is missing.");
    FoldErrors all;
    all.stages = tree.attribute<FoldStage>(stages_name);
    for (const FoldStage& stage : all.stages)
        if (!is_sound(stage)) return refused("a contrast of a stage is negative or not finite.");
    for (NodeId node = 0; node < nodes; ++node) {
        const bool has_stage = all.stages.empty() || stage_of[node] < all.stages.size();
        if (!is_sound(records[node]) || facing[node].fading > most_fading ||
            !(textures.empty() || is_sound(textures[node])))
            return refused("an error of node " + std::to_string(node) + " is negative or not finite.");
        if (!has_stage) return refused("node " + std::to_string(node) + " folds in a stage that is not there.");
    }
    all.of_nodes = nested_errors(tree, records, facing, textures, model);
    for (NodeId node = tree.interior_count(); node-- > 0;) {
        FoldError& error = all.of_nodes[node];
        error.stage = std::max(error.stage, stage_of[node]);
        if (node > 0)
            all.of_nodes[tree.parents()[node]].stage = std::max(all.of_nodes[tree.parents()[node]].stage, error.stage);
        // Factors may lead beyond all numbers.
        for (const float value : {error.distance, error.outline, error.luminance, error.wide_luminance})
            if (!std::isfinite(value)) return refused("an error of node " + std::to_string(node) + " is too large.");
    }
    return all;
}

using vdtree::NodeId;

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

Result<LitTrees> LitTrees::of(std::span<const TreeAsLit> trees, const FoldModel& model) {
    if (trees.empty()) return invalid_argument("fold test: there is no tree under lights to look at");
    double albedo = 0;
    const vdtree::VertexTree& first = trees.front().tree;
    for (vdtree::WedgeId wedge = 0; wedge < first.wedge_count(); ++wedge)
        albedo = std::max(albedo, static_cast<double>(vdtree::albedo_of(first, wedge)));
    LitTrees all;
    all.sound_.reserve(trees.size()), all.errors_.reserve(trees.size()); // they are referred to
    for (const TreeAsLit& one : trees) {
        if (one.tree.interior_count() != first.interior_count())
            return invalid_argument("fold test: the trees under lights are not of one tree");
        auto tree = vdtree::SoundTree::of(one.tree);
        if (!tree) return tree.error();
        all.sound_.push_back(std::move(*tree));
        auto measured = fold_errors_of(all.sound_.back(), model);
        if (!measured) return measured.error();
        all.errors_.push_back(std::move(*measured));
        const auto chroma = one.tree.texture().empty() ? ring_chroma(one.tree) : std::vector<ChromaRange>();
        if (!chroma) return chroma.error();
        all.lit_.push_back({&all.sound_.back(), all.errors_.back().of_nodes, {}, albedo});
        if (all.lit_.size() == 1)
            all.lit_.back().colour_reach = as_luminance(colour_reach(one.tree)); // the first decides
        for (const ChromaRange& range : *chroma) all.lit_.back().colour_range.push_back(as_luminance(range));
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

double needed_sensitivity(const FoldModel& model, Degrees eccentricity) {
    const auto& at = FoldModel::needed_at_degrees;
    const double e = std::clamp(eccentricity.value(), at.front(), at.back());
    std::size_t i = 0;
    while (i + 2 < at.size() && e > at[i + 1]) ++i;
    return std::lerp(model.needed[i], model.needed[i + 1], (e - at[i]) / (at[i + 1] - at[i]));
}

Result<void> validate(const FoldModel& m) {
    for (const double factor : {m.neighbourhood, m.needed_by_outlines, m.contact_reach, m.least_sine})
        if (!(factor >= 0 && std::isfinite(factor)))
            return invalid_argument("fold test: the model's factors must be finite, and 0 or more");
    for (std::size_t i = 0; i < m.needed.size(); ++i)
        if (!(m.needed[i] > 0 && m.needed[i] <= (i > 0 ? m.needed[i - 1] : 1e3)))
            return invalid_argument("fold test: the sensitivity needed, model.needed[" + std::to_string(i) +
                                    "], must be above 0 and not rise with the eccentricity");
    if (m.neighbourhood == 0 || m.needed_by_outlines == 0)
        return invalid_argument("fold test: the model's neighbourhood and needed_by_outlines must be above 0");
    return {};
}

} // namespace unseen::perception
