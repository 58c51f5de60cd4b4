// The test by errors under a scene's masking. Nodes differ in what masks them, and a table of switch distances holds
// for one such way. So a few ways are chosen that most nodes are masked by at least; for each there is a table, and
// each node goes by one that masks no more than what it has. What comes out is the unmasked criterion with shorter
// lengths.
#include <map>

#include <unseen/perception/masking.h>
#include <unseen/vdtree/internal/footprint.h>

#include "fold/error_distances.h"

namespace unseen::perception {
namespace {

constexpr std::size_t most_bands = 16; // as many as judges have
// Pixels around what a node covers: outlines move by less than a pixel without being seen.
constexpr int margin_px = 1;
// A question looks at so many cells along each axis at most.
constexpr int cells_a_side = 3;

Error refused(const std::string& what) { return {ErrorCode::invalid_argument, "masking: " + what}; }

Result<void> check(const vdtree::View& view, const MaskingPicture::Elevations& of,
                   const MaskingPicture::Elevations& first) {
    if (of.cell_px < 1 || of.columns < 1 || of.rows < 1) return refused("there are no cells");
    if (of.columns != (view.width + of.cell_px - 1) / of.cell_px ||
        of.rows != (view.height + of.cell_px - 1) / of.cell_px)
        return refused("the cells do not cover the view's window");
    if (of.bands.empty() || of.bands.size() > most_bands) return refused("elevations are of 1 to 16 bands");
    if (of.cell_px != first.cell_px || of.bands != first.bands) return refused("pictures differ in cells or bands");
    for (std::size_t i = 0; i < of.bands.size(); ++i)
        if (!(of.bands[i].value() > 0) || (i > 0 && !(of.bands[i] < of.bands[i - 1])))
            return refused("frequencies must be above 0, and fall");
    if (of.elevation.size() !=
        of.bands.size() * static_cast<std::size_t>(of.columns) * static_cast<std::size_t>(of.rows))
        return refused("there are not as many elevations as bands by cells");
    for (std::size_t i = 0; i < of.elevation.size(); ++i)
        if (!(of.elevation[i] >= 1 && std::isfinite(of.elevation[i])))
            return refused("elevation " + std::to_string(i) + " must be 1 or more, and finite");
    return {};
}

} // namespace

Result<MaskingPicture> MaskingPicture::create(const vdtree::View& view, std::span<const Elevations> pictures) {
    if (const auto valid = vdtree::validate(view); !valid) return valid.error();
    if (pictures.empty()) return refused("there is no picture");
    for (const Elevations& picture : pictures)
        if (const auto ok = check(view, picture, pictures.front()); !ok) return ok.error();
    auto grids = std::make_shared<Grids>();
    grids->view = view;
    grids->cell_px = pictures.front().cell_px;
    grids->bands = pictures.front().bands;
    Grid finest{pictures.front().columns, pictures.front().rows, pictures.front().elevation};
    for (const Elevations& picture : pictures.subspan(1))
        for (std::size_t i = 0; i < finest.least.size(); ++i)
            finest.least[i] = std::min(finest.least[i], picture.elevation[i]);
    grids->levels.push_back(std::move(finest));
    while (grids->levels.back().columns > 1 || grids->levels.back().rows > 1) {
        const Grid& fine = grids->levels.back();
        Grid coarse{(fine.columns + 1) / 2, (fine.rows + 1) / 2, {}};
        for (std::size_t band = 0; band < grids->bands.size(); ++band)
            for (int y = 0; y < coarse.rows; ++y)
                for (int x = 0; x < coarse.columns; ++x) {
                    const auto at = [&](int column, int row) {
                        return fine.at(band, std::min(column, fine.columns - 1), std::min(row, fine.rows - 1));
                    };
                    coarse.least.push_back(std::min(
                        {at(2 * x, 2 * y), at(2 * x + 1, 2 * y), at(2 * x, 2 * y + 1), at(2 * x + 1, 2 * y + 1)}));
                }
        grids->levels.push_back(std::move(coarse));
    }
    return MaskingPicture(std::move(grids));
}

void MaskingPicture::least(const vdtree::Footprint& of, std::span<float> elevation) const noexcept {
    const Grids& all = *grids_;
    std::fill(elevation.begin(), elevation.end(), 1.0f);
    const double width = all.view.width, height = all.view.height;
    if (!(of.nearest > 0) || !(of.right >= 0 && of.bottom >= 0 && of.left <= width && of.top <= height)) return;
    // What is outside of the window is seen by nobody.
    const auto cell_of = [&](double px, int cells) {
        return std::clamp(static_cast<int>(std::floor(px)) / all.cell_px, 0, cells - 1);
    };
    const auto within = [](double px, double size) { return std::clamp(px, 0.0, size); };
    const int columns = all.levels.front().columns, rows = all.levels.front().rows;
    const int left = cell_of(within(of.left - margin_px, width), columns),
              right = cell_of(within(of.right + margin_px, width), columns),
              top = cell_of(within(of.top - margin_px, height), rows),
              bottom = cell_of(within(of.bottom + margin_px, height), rows);
    std::size_t level = 0;
    while ((right >> level) - (left >> level) >= cells_a_side || (bottom >> level) - (top >> level) >= cells_a_side)
        ++level;
    const Grid& grid = all.levels[level];
    for (std::size_t band = 0; band < elevation.size() && band < all.bands.size(); ++band) {
        float least = std::numeric_limits<float>::max();
        for (int y = top >> level; y <= bottom >> level; ++y)
            for (int x = left >> level; x <= right >> level; ++x) least = std::min(least, grid.at(band, x, y));
        elevation[band] = least;
    }
}

namespace {

using vdtree::DistanceCriterion;
using vdtree::NodeId;

// Elevations are rounded down to quarters of octaves, and up to eight: what is masked by more is rare.
constexpr int steps_per_octave = 4, most_steps = 12;
// Ways of being masked that a criterion knows, that of not being masked included. Eight have nearly all that more
// would.
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

// By node, the one of the chosen that masks the most of what the node has, and no less than its parent's: so costs do
// not fall towards the root.
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

// A kind of class that nodes have, and their lengths.
struct Kind {
    std::uint16_t vdtree::FoldClass::*row;
    std::vector<float> DistanceCriterion::Parts::*lengths;
};
constexpr Kind kinds[] = {{&vdtree::FoldClass::interior, &DistanceCriterion::Parts::lengths},
                          {&vdtree::FoldClass::silhouette, &DistanceCriterion::Parts::silhouette_lengths}};

// From how far a node goes unseen, by bin.
class Distances {
public:
    Distances(const DistanceCriterion::Parts& parts, const Kind& kind, NodeId node)
        : length_((parts.*kind.lengths)[node]),
          switch_distance_(
              std::span(parts.switch_distance)
                  .subspan(parts.classes[node].*kind.row * parts.eccentricity_bins, parts.eccentricity_bins)) {}

    // The largest share that these are of others, at most 1.
    float share_of(const Distances& others) const {
        constexpr float rounding = 4e-6f; // of the products
        float share = 0;
        for (std::size_t bin = 0; bin < switch_distance_.size(); ++bin) {
            const float of = others.at(bin);
            if (of > 0) share = std::max(share, at(bin) / of * (1 + rounding));
        }
        return share < 1 ? share : 1; // 1 where both reach everywhere
    }

private:
    float at(std::size_t bin) const { return length_ * std::max(switch_distance_[bin], 0.0f); }

    float length_;
    std::span<const float> switch_distance_;
};

// By node, which share of its unmasked distances is left.
std::vector<float> shares_left(const DistanceCriterion::Parts& unmasked,
                               std::span<const DistanceCriterion::Parts> masked, const Kind& kind,
                               std::span<const std::uint8_t> ways, std::span<const NodeId> parents) {
    std::vector<float> shares(ways.size(), 0);
    for (std::size_t i = ways.size(); i-- > 0;) { // children before parents
        const auto node = static_cast<NodeId>(i);
        const Distances all(unmasked, kind, node);
        const float own = ways[i] == 0 ? 1 : Distances(masked[ways[i]], kind, node).share_of(all);
        shares[i] = std::max(shares[i], own); // no nearer than the children
        if (i == 0) break;
        const NodeId parent = parents[node];
        shares[parent] = std::max(shares[parent], std::min(1.0f, shares[i] * all.share_of({unmasked, kind, parent})));
    }
    return shares;
}

} // namespace

Result<DistanceCriterion> masked_error_distances(const vdtree::VertexTree& tree, const vdtree::Similarity& placement,
                                                 const MaskingPicture& masking, const vdtree::View& view,
                                                 const FoldTestOptions& options) {
    const TreeAsLit own{tree.share(), {}};
    return masked_error_distances({&own, 1}, placement, masking, view, options);
}

Result<DistanceCriterion> masked_error_distances(std::span<const TreeAsLit> as_lit, const vdtree::Similarity& placement,
                                                 const MaskingPicture& masking, const vdtree::View& view,
                                                 const FoldTestOptions& options) {
    if (masking.view().width != view.width || masking.view().height != view.height)
        return invalid_argument("masking: the picture is of another window than the view");
    if (const auto valid = check_arguments(view, options); !valid) return valid.error();
    if (const auto valid = validate(options.model); !valid) return valid.error();
    const auto trees = LitTrees::of(as_lit, options.model);
    if (!trees) return trees.error();
    const vdtree::SoundTree& tree = trees->tree();
    const auto footprints = vdtree::find_footprints(tree, placement, masking.view());
    if (!footprints) return footprints.error();

    const std::vector<Way> of_nodes = ways_of_nodes(masking, *footprints), chosen = choose_ways(of_nodes);
    const std::vector<std::uint8_t> assigned = assign_ways(of_nodes, chosen, tree.parents());
    const auto parts_under = [&](const BandElevation& elevation) {
        return criterion_parts(trees->as_lit(), trees->stages(), view, options, elevation);
    };
    DistanceCriterion::Parts unmasked = parts_under({});
    std::vector<DistanceCriterion::Parts> masked(chosen.size()); // none of the first
    for (std::size_t way = 1; way < chosen.size(); ++way)
        if (std::ranges::find(assigned, way) != assigned.end())
            masked[way] = parts_under(elevation_of(chosen[way], masking.bands()));
    std::vector<float> shares[std::size(kinds)];
    for (std::size_t kind = 0; kind < std::size(kinds); ++kind)
        shares[kind] = shares_left(unmasked, masked, kinds[kind], assigned, tree.parents());
    for (std::size_t kind = 0; kind < std::size(kinds); ++kind)
        for (NodeId node = 0; node < tree.interior_count(); ++node)
            (unmasked.*kinds[kind].lengths)[node] *= shares[kind][node];
    return DistanceCriterion::create(tree, std::move(unmasked));
}

} // namespace unseen::perception
