#include "fold/fold_errors.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "fold/fold_factors.h"
#include "fold/pooling.h"
#include "measure/measurement.h"
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
        error.outline = std::max(error.outline, record.border);
        error.facing |= facing[node].facing;
        error.bias = record.bias, error.fading = facing[node].fading;
        // Where parts meet, a fold moves the line along which the one hides the other, like an outline, whatever they
        // face: the farther, the flatter they meet. That is nothing that a mean over cells would tell.
        const float moved = std::max(error.distance, moved_point);
        if (moved > 0 && record.gap < contact_reach * moved) {
            error.facing = NormalSlabs::everything();
            error.distance = std::max(moved, std::min(moved / std::max(record.sine, least_sine), ring));
        }
        error.outline = std::max(error.outline, error.distance);
        if (node == 0) break;
        FoldError& parent = errors[tree.parents()[node]];
        parent.distance = std::max(parent.distance, error.distance);
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
        return Error{
            ErrorCode::invalid_argument,
            Message::of(
                "The errors of the tree's folds are not measured: measure them with {perception::measure_folds()}.")};
    if (!std::ranges::equal(settings, measurement::settings))
        return Error{
            ErrorCode::unsupported,
            Message::of("The tree's folds were measured with other settings than this program knows: measure them "
                        "again with {perception::measure_folds()}.")};
    const std::size_t nodes = tree.interior_count();
    if (records.size() != nodes || facing.size() != nodes || stage_of.size() != nodes ||
        textures.size() != (tree.texture().empty() ? 0 : nodes))
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

} // namespace unseen::perception
