// The test by errors under a scene's masking. Nodes differ in what masks them, and a table of switch distances holds for
// one such way. So a few ways are chosen that most nodes are masked by at least; each has the rows of its own, and each
// node goes by one that masks no more than what it has.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <vector>

#include <perception/masking.h>

#include "fold/band_elevation.h"
#include "fold/error_distances.h"
#include "fold/fold_screen.h"

namespace unseen::perception {
namespace {

using vdtree::DistanceCriterion;
using vdtree::NodeId;

constexpr std::size_t most_bands = 16;
// Elevations are rounded down to half octaves, and up to eight: what is masked by more is rare.
constexpr int steps_per_octave = 2, most_steps = 6;
// Ways of being masked that a criterion knows, that of not being masked included. Eight have nearly all that more would.
constexpr std::size_t most_ways = 8;
// The ways that these are chosen from: the most frequent ones.
constexpr std::size_t most_candidates = 256;

// How nodes are masked: by band, in steps.
using Way = std::array<std::uint8_t, most_bands>;

bool is_within(const Way& a, const Way& b) {
    for (std::size_t i = 0; i < most_bands; ++i)
        if (a[i] > b[i]) return false;
    return true;
}

int gain_of(const Way& way) {
    int sum = 0;
    for (const std::uint8_t steps : way) sum += steps;
    return sum;
}

std::vector<Way> ways_of_nodes(const MaskingPicture& masking, std::span<const vdtree::Footprint> footprints) {
    std::vector<Way> ways(footprints.size());
    std::array<float, most_bands> elevation{};
    const auto bands = std::span(elevation).first(masking.bands().size());
    for (std::size_t node = 0; node < ways.size(); ++node) {
        masking.least(footprints[node], bands);
        ways[node] = {};
        for (std::size_t i = 0; i < bands.size(); ++i)
            ways[node][i] = static_cast<std::uint8_t>(
                std::clamp(static_cast<int>(std::floor(steps_per_octave * std::log2(bands[i]))), 0, most_steps));
    }
    return ways;
}

// The ways that together leave the least of what nodes have; the first is that of not being masked.
std::vector<Way> choose_ways(std::span<const Way> of_nodes) {
    std::map<Way, std::size_t> counts;
    for (const Way& way : of_nodes) ++counts[way];
    std::vector<std::pair<Way, std::size_t>> all(counts.begin(), counts.end());
    std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
    std::vector<int> gains(all.size(), 0); // by what was chosen so far
    std::vector<Way> chosen = {Way{}};
    while (chosen.size() < most_ways) {
        std::size_t best = all.size(), best_gain = 0;
        for (std::size_t candidate = 0; candidate < std::min(all.size(), most_candidates); ++candidate) {
            const int own = gain_of(all[candidate].first);
            std::size_t gain = 0;
            for (std::size_t i = 0; i < all.size(); ++i)
                if (own > gains[i] && is_within(all[candidate].first, all[i].first))
                    gain += all[i].second * static_cast<std::size_t>(own - gains[i]);
            if (gain > best_gain) best = candidate, best_gain = gain;
        }
        if (best == all.size()) break;
        for (std::size_t i = 0; i < all.size(); ++i)
            if (is_within(all[best].first, all[i].first)) gains[i] = std::max(gains[i], gain_of(all[best].first));
        chosen.push_back(all[best].first);
    }
    return chosen;
}

// By node, the one of the chosen that masks the most of what the node has, and no less than its parent's: so costs do not
// fall towards the root.
std::vector<std::uint8_t> assign_ways(std::span<const Way> of_nodes, std::span<const Way> chosen,
                                      std::span<const NodeId> parents) {
    std::vector<std::uint8_t> assigned(of_nodes.size(), 0);
    for (std::size_t node = 0; node < of_nodes.size(); ++node) { // parents before children
        std::size_t best = node > 0 ? assigned[parents[node]] : 0;
        const Way& above = chosen[best];
        for (std::size_t i = 0; i < chosen.size(); ++i)
            if (is_within(above, chosen[i]) && is_within(chosen[i], of_nodes[node]) &&
                gain_of(chosen[i]) > gain_of(chosen[best]))
                best = i;
        assigned[node] = static_cast<std::uint8_t>(best);
    }
    return assigned;
}

BandElevation elevation_of(const Way& way, std::span<const CyclesPerDegree> bands) {
    std::vector<double> cpd, elevation;
    for (std::size_t i = 0; i < bands.size(); ++i) {
        cpd.push_back(bands[i].value());
        elevation.push_back(std::exp2(static_cast<double>(way[i]) / steps_per_octave));
    }
    return {std::move(cpd), std::move(elevation)};
}

// Whether a node goes unseen from no farther by one table than by another, whatever it faces.
bool is_no_farther(const DistanceCriterion::Parts& a, const DistanceCriterion::Parts& b, NodeId node) {
    const std::size_t bins = a.eccentricity_bins;
    for (std::size_t bin = 0; bin < bins; ++bin) {
        const auto at = [&](const DistanceCriterion::Parts& p, std::size_t row, float length) {
            return length * std::max(p.switch_distance[row * bins + bin], 0.0f);
        };
        if (at(a, a.classes[node].interior, a.lengths[node]) > at(b, b.classes[node].interior, b.lengths[node]) ||
            at(a, a.classes[node].silhouette, a.silhouette_lengths[node]) >
                at(b, b.classes[node].silhouette, b.silhouette_lengths[node]))
            return false;
    }
    return true;
}

} // namespace

Result<DistanceCriterion> masked_error_distances(const vdtree::VertexTree& tree, const vdtree::Similarity& placement,
                                                 const MaskingPicture& masking, const vdtree::View& view,
                                                 const FoldTestOptions& options) {
    if (masking.view().width != view.width || masking.view().height != view.height)
        return Error{ErrorCode::invalid_argument, "masking: the picture is of another window than the view"};
    if (const auto valid = check_arguments(view, options); !valid) return valid.error();
    if (const auto valid = validate(options.model); !valid) return valid.error();
    const auto sound = vdtree::SoundTree::of(tree);
    if (!sound) return sound.error();
    const auto errors = fold_errors_of(*sound, options.model);
    if (!errors) return errors.error();
    const auto footprints = vdtree::find_footprints(tree, placement, masking.view());
    if (!footprints) return footprints.error();

    const std::vector<Way> of_nodes = ways_of_nodes(masking, *footprints), chosen = choose_ways(of_nodes);
    const std::vector<std::uint8_t> assigned = assign_ways(of_nodes, chosen, sound->parents());
    constexpr std::size_t all_rows = std::size_t{std::numeric_limits<std::uint16_t>::max()} + 1;
    const std::size_t most_rows = all_rows / chosen.size();
    DistanceCriterion::Parts parts = criterion_parts(*sound, *errors, view, options, {}, most_rows);
    for (std::size_t way = 1; way < chosen.size(); ++way) {
        if (std::ranges::find(assigned, way) == assigned.end()) continue;
        const DistanceCriterion::Parts masked =
            criterion_parts(*sound, *errors, view, options, elevation_of(chosen[way], masking.bands()), most_rows);
        const auto first_row = static_cast<std::uint16_t>(parts.switch_distance.size() / parts.eccentricity_bins);
        parts.switch_distance.insert(parts.switch_distance.end(), masked.switch_distance.begin(),
                                     masked.switch_distance.end());
        for (NodeId node = 0; node < tree.interior_count(); ++node) {
            // Rounding to fewer rows may come out larger.
            if (assigned[node] != way || !is_no_farther(masked, parts, node)) continue;
            parts.classes[node] = {static_cast<std::uint16_t>(first_row + masked.classes[node].interior),
                                   static_cast<std::uint16_t>(first_row + masked.classes[node].silhouette)};
            parts.lengths[node] = masked.lengths[node];
            parts.silhouette_lengths[node] = masked.silhouette_lengths[node];
        }
    }
    return DistanceCriterion::create(tree, std::move(parts));
}

} // namespace unseen::perception
