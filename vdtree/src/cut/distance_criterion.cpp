#include <unseen/vdtree/depth_picture.h>

#include <numbers>

#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/contrast_classes.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/node_bits.h>

#include "cut/kernel/fold_kernel.h"
#include "tree/unchecked_links.h"

namespace unseen::vdtree {

namespace {

// With lights, rows are compared by their contrasts and luminances.
Result<void> check_growth(const DistanceCriterion::Parts& p) {
    const std::size_t bins = p.eccentricity_bins;
    const auto grows = [&](std::size_t from, std::size_t to) {
        for (std::size_t bin = 0; bin < bins; ++bin) {
            if (!(p.switch_distance[from * bins + bin] <= p.switch_distance[to * bins + bin])) return false;
            if (!p.least_cost.empty() && !(p.least_cost[from * bins + bin] <= p.least_cost[to * bins + bin]))
                return false;
        }
        return true;
    };
    for (std::size_t l = 0; l < ContrastClasses::level_count; ++l)
        for (std::size_t c = 0; c < ContrastClasses::contrast_count; ++c)
            if ((c > 0 && !grows(ContrastClasses::class_at(l, c - 1), ContrastClasses::class_at(l, c))) ||
                (l > 0 && !grows(ContrastClasses::class_at(l - 1, c), ContrastClasses::class_at(l, c))))
                return invalid_argument(
                    "The switch distances of a criterion with lights must not fall with the contrast or the "
                    "luminance.");
    return {};
}

Result<void> check(const VertexTree& tree, const DistanceCriterion::Parts& p) {
    const std::size_t nodes = tree.interior_count();
    for (const auto& [count, what] : {std::pair(p.classes.size(), "classes"),
                                      {p.facing.size(), "sets of directions"},
                                      {p.lengths.size(), "lengths"},
                                      {p.silhouette_lengths.size(), "lengths"}})
        if (count != 0 && count != nodes)
            return invalid_argument("A criterion has " + std::to_string(count) + " " + what + " for " +
                                    std::to_string(nodes) + " interior nodes.");
    if (p.lit && (!p.lit->bounds || p.lit->bounds->cones().size() != nodes || !p.classes.empty()))
        return invalid_argument("A criterion with lights needs bounds of its tree's normals, and no other classes.");
    for (const auto* lengths : {&p.lengths, &p.silhouette_lengths})
        for (std::size_t i = 0; i < lengths->size(); ++i)
            if (!((*lengths)[i] >= 0) || !std::isfinite((*lengths)[i]))
                return invalid_argument("The length of node " + std::to_string(i) + " must be 0 or more and finite.");
    if (p.eccentricity_bins == 0 || p.switch_distance.empty() || p.switch_distance.size() % p.eccentricity_bins != 0)
        return invalid_argument("A criterion's table of " + std::to_string(p.switch_distance.size()) +
                                " switch distances has no whole rows of " + std::to_string(p.eccentricity_bins) +
                                " bins.");
    if (!p.least_cost.empty() && p.least_cost.size() != p.switch_distance.size())
        return invalid_argument("A criterion's table of least costs is not of the size of its switch distances.");
    for (std::size_t i = 0; i < p.least_cost.size(); ++i)
        if (!(p.least_cost[i] >= 0) || (i % p.eccentricity_bins != 0 && p.least_cost[i] > p.least_cost[i - 1]))
            return invalid_argument("Least cost " + std::to_string(i) +
                                    " of a criterion is negative, not a number, or grows with the eccentricity.");
    if (!(p.bin_degrees > 0) || !std::isfinite(p.bin_degrees))
        return invalid_argument("The bins of eccentricity need a positive width.");
    const std::size_t rows = p.switch_distance.size() / p.eccentricity_bins;
    if (p.lit && !(p.lit->scale.offset >= 0 && p.lit->scale.span > 0 && std::isfinite(p.lit->scale.of(1))))
        return invalid_argument(
            "A criterion with lights needs a scale whose offset is 0 or more and whose span is above 0.");
    if (p.lit && (rows < ContrastClasses::class_count || p.lit->silhouette >= rows))
        return invalid_argument("A criterion with lights needs a row for each class of contrasts.");
    if (p.lit)
        if (const auto grows = check_growth(p); !grows) return grows.error();
    for (std::size_t i = 0; i < p.classes.size(); ++i)
        if (p.classes[i].interior >= rows || p.classes[i].silhouette >= rows)
            return invalid_argument("Node " + std::to_string(i) + " has a class beyond the " + std::to_string(rows) +
                                    " rows of the table.");
    for (std::size_t i = 0; i < p.switch_distance.size(); ++i) {
        if (std::isnan(p.switch_distance[i]))
            return invalid_argument("Switch distance " + std::to_string(i) + " of a criterion is not a number.");
        if (i % p.eccentricity_bins != 0 && p.switch_distance[i] > p.switch_distance[i - 1])
            return invalid_argument("Switch distance " + std::to_string(i) +
                                    " of a criterion grows with the eccentricity.");
    }
    return {};
}

// By how much longer a node of one row must be than one of another to be seen from as far everywhere: few pairs of rows
// come again and again.
class RowRatios {
public:
    explicit RowRatios(const DistanceCriterion::Parts& parts) : parts_(parts), known_(1u << known_bits) {}

    // Infinite where no length makes up for the row.
    float largest(std::uint16_t row, std::uint16_t of) {
        if (row == of) return 1;
        const std::uint32_t pair = row * 0x10000u + of;
        Known& known = known_[(pair * 0x9e3779b1u) >> (32 - known_bits)];
        if (known.pair != pair) known = {pair, compare(row, of)};
        return known.ratio;
    }

private:
    // A few roundings of the products of lengths and switch distances.
    static constexpr float rounding = 1e-6f;
    static constexpr float infinity = std::numeric_limits<float>::infinity();

    float compare(std::uint16_t row, std::uint16_t of) const {
        const std::size_t bins = parts_.eccentricity_bins, a = row * bins, b = of * bins;
        float ratio = 0;
        for (std::size_t bin = 0; bin < bins; ++bin) {
            const float needed = parts_.switch_distance[a + bin], given = parts_.switch_distance[b + bin];
            if (!parts_.least_cost.empty() && parts_.least_cost[a + bin] > parts_.least_cost[b + bin]) return infinity;
            if (needed <= DistanceCriterion::never_visible) continue;
            if (!(given >= 0) || (!(given > 0) && needed > 0)) return infinity;
            const bool is_everywhere = given >= DistanceCriterion::always_visible;
            if (needed > 0 && !is_everywhere) ratio = std::max(ratio, needed / given);
        }
        // Products of lengths and switch distances that are both no larger are exactly so.
        return ratio <= 1 ? std::min(ratio * (1 + rounding), 1.0f) : ratio * (1 + rounding);
    }

    static constexpr unsigned known_bits = 14;
    struct Known {
        std::uint32_t pair = 0; // of row 0 and itself, which is not asked about
        float ratio = 1;
    };
    const DistanceCriterion::Parts& parts_;
    std::vector<Known> known_;
};

// Spheres nest in every tree.
bool is_monotone_in(const VertexTree& tree, const DistanceCriterion::Parts& p) {
    const auto parents = unchecked_links(tree).parents;
    RowRatios ratios(p);
    const auto is_within = [](std::span<const float> lengths, NodeId node, NodeId parent, float ratio) {
        if (lengths.empty()) return ratio <= 1;          // spheres' radii
        return lengths[node] * ratio <= lengths[parent]; // false where the ratio is infinite and the length 0
    };
    for (NodeId node = 1; node < tree.interior_count(); ++node) {
        const NodeId parent = parents[node];
        if (!(parent < node)) return false; // in a damaged file: nobody has looked at all of a mapped tree
        if (!p.facing.empty() && !p.facing[parent].includes(p.facing[node])) return false;
        const FoldClass a = p.classes.empty() ? FoldClass{} : p.classes[node],
                        b = p.classes.empty() ? FoldClass{} : p.classes[parent];
        const auto& outlines = p.silhouette_lengths.empty() ? p.lengths : p.silhouette_lengths;
        if (!is_within(p.lengths, node, parent, ratios.largest(a.interior, b.interior))) return false;
        if (!is_within(outlines, node, parent, ratios.largest(a.silhouette, b.silhouette))) return false;
    }
    return true;
}

const Sphere& sphere_of(const VertexTree& tree, const DistanceCriterion::Parts& parts, NodeId node) {
    return parts.spheres == DistanceCriterion::Spheres::ring ? tree.bounds()[node].ring : tree.support_spheres()[node];
}
float radius_of(const VertexTree& tree, const DistanceCriterion::Parts& parts, NodeId node) {
    return sphere_of(tree, parts, node).radius;
}

// Which nodes unfold only where the eye is nearer than their radius: what is flat.
bool is_flat(const VertexTree& tree, const DistanceCriterion::Parts& p, NodeId node) {
    const float radius = radius_of(tree, p, node);
    const FoldClass rows = p.classes.empty() ? FoldClass{} : p.classes[node];
    const auto distance = [&](std::uint16_t row, const std::vector<float>& lengths) {
        return (lengths.empty() ? radius : lengths[node]) * p.switch_distance[row * p.eccentricity_bins];
    };
    if (!(distance(rows.interior, p.lengths) < radius)) return false;
    return !(tree.bounds()[node].flags & irregular_ring) ||
           distance(rows.silhouette, p.silhouette_lengths.empty() ? p.lengths : p.silhouette_lengths) < radius;
}

// See DistanceCriterion::Reach: twice the radius of the largest flat nodes that triangles lead to. Files are not trusted:
// nobody has looked at all of a mapped tree.
std::shared_ptr<const DistanceCriterion::Reach> find_reach(const VertexTree& tree, const DistanceCriterion::Parts& p) {
    auto reach = std::make_shared<DistanceCriterion::Reach>();
    if (p.lit) return reach;
    const NodeId nodes = tree.interior_count();
    const auto& links = unchecked_links(tree);
    std::vector<NodeId> flat(nodes, no_node); // the largest that a node is in
    bool has_flat = false;
    for (NodeId node = 0; node < nodes; ++node) {
        const NodeId parent = links.parents[node];
        if (parent < node) flat[node] = flat[parent];
        if (flat[node] == no_node && is_flat(tree, p, node)) flat[node] = node, has_flat = true;
    }
    if (!has_flat) return reach;
    std::vector<float> widths(nodes);
    for (const Triangle& triangle : links.triangles) {
        std::array<NodeId, 3> over; // the corners' places
        bool is_sound = true;
        for (std::size_t k = 0; k < 3 && is_sound; ++k) {
            const NodeId place = triangle[k] < tree.leaf_count() ? tree.place_of_leaf(triangle[k]) : no_node;
            is_sound = place < tree.node_count() && links.parents[place] < nodes;
            if (is_sound) over[k] = links.parents[place];
        }
        for (std::size_t k = 0; k < 9 && is_sound; ++k)
            if (const NodeId node = over[k / 3], beside = flat[over[k % 3]]; beside != no_node && beside != flat[node])
                widths[node] = std::max(widths[node], 2 * radius_of(tree, p, beside));
    }
    for (NodeId node = nodes; node-- > 1;)
        if (const NodeId parent = links.parents[node]; parent < node)
            widths[parent] = std::max(widths[parent], widths[node]);
    const float longest = *std::max_element(widths.begin(), widths.end());
    if (!(longest > 0) || !std::isfinite(longest)) return reach;
    reach->longest = longest;
    constexpr float most_octaves = 63;
    for (const float width : widths)
        reach->octaves.push_back(static_cast<std::uint8_t>(
            width > 0 ? std::max(1.0f, most_octaves - std::floor(std::log2(longest / width))) : 0.0f));
    return reach;
}

// Gives a row of one switch distance and no least cost to some nodes.
Result<void> give_row(DistanceCriterion::Parts& parts, NodeId nodes, float switch_distance,
                      std::span<const std::uint64_t> which) {
    const std::size_t row = parts.switch_distance.size() / parts.eccentricity_bins;
    if (row > std::numeric_limits<std::uint16_t>::max())
        return invalid_argument("The criterion has no room for a row more.");
    parts.classes.resize(nodes); // empty: the first row for all
    parts.switch_distance.insert(parts.switch_distance.end(), parts.eccentricity_bins, switch_distance);
    if (!parts.least_cost.empty()) parts.least_cost.insert(parts.least_cost.end(), parts.eccentricity_bins, 0.0f);
    const auto number = static_cast<std::uint16_t>(row);
    for (NodeId node = 0; node < nodes; ++node)
        if (test_bit(which, node)) parts.classes[node] = {number, number};
    return {};
}

// See keeping().
Result<void> keep(const VertexTree& tree, DistanceCriterion::Parts& parts, std::span<const std::uint64_t> kept) {
    // With lights there are no classes: those that are kept are outlines of the scene's contrast.
    const NodeId nodes = tree.interior_count();
    if (!parts.lit)
        if (const auto given = give_row(parts, nodes, DistanceCriterion::always_visible, kept); !given)
            return given.error();
    if (parts.silhouette_lengths.empty()) parts.silhouette_lengths = parts.lengths;
    const bool has_lengths = !parts.silhouette_lengths.empty(), has_facing = !parts.facing.empty();
    for (NodeId node = 0; node < nodes; ++node) {
        if (!has_lengths) parts.silhouette_lengths.push_back(radius_of(tree, parts, node));
        if (!has_facing) parts.facing.push_back(tree.bounds()[node].slabs);
        if (!test_bit(kept, node)) continue;
        parts.silhouette_lengths[node] = kept_length;
        parts.facing[node] = NormalSlabs::everything(); // whatever faces the eye
    }
    return {};
}

// Folds of protected nodes count as if they were as many times as large.
void weigh(const VertexTree& tree, DistanceCriterion::Parts& parts) {
    const auto weights = tree.fold_weights();
    if (std::exchange(parts.is_weighted, true) || weights.size() <= 1) return;
    for (NodeId node = 0; parts.lengths.size() < weights.size(); ++node)
        parts.lengths.push_back(radius_of(tree, parts, node));
    constexpr float largest = kept_length / 2; // what is kept anyway stays so; an infinite root is kept besides
    for (auto* lengths : {&parts.lengths, &parts.silhouette_lengths})
        for (std::size_t i = 0; i < lengths->size(); ++i)
            if (float& length = (*lengths)[i]; length > 0 && length < largest)
                length = std::min(length * weights[i], largest);
}

} // namespace

Result<DistanceCriterion> DistanceCriterion::create(const VertexTree& tree, Parts parts) {
    return create(tree, std::move(parts), nullptr);
}

Result<DistanceCriterion> DistanceCriterion::create(const VertexTree& tree, Parts parts,
                                                    std::shared_ptr<const Reach> reach) {
    if (const auto valid = check(tree, parts); !valid) return valid.error();
    weigh(tree, parts);
    if (tree.is_locked()) {
        std::vector<std::uint64_t> root(words_for(tree.interior_count()));
        set_bit(root, VertexTree::root());
        if (const auto kept = keep(tree, parts, root); !kept) return kept.error();
    }
    for (float& switch_distance : parts.switch_distance)
        switch_distance = std::clamp(switch_distance, never_visible, always_visible);
    if (!reach) reach = find_reach(tree, parts);
    const bool uses_silhouettes = std::any_of(parts.classes.begin(), parts.classes.end(),
                                              [](FoldClass c) { return c.interior != c.silhouette; }) ||
                                  (!parts.classes.empty() && !parts.silhouette_lengths.empty()) || parts.lit;
    // With lights the ranges nest but for rounding, which may lift a child by a class.
    const bool is_monotone = !parts.lit && is_monotone_in(tree, parts);
    return DistanceCriterion(std::make_shared<const Values>(
        Values{std::move(parts), std::move(reach), tree.interior_count(), uses_silhouettes, is_monotone}));
}

struct ChangedCriterion {
    static Result<DistanceCriterion> of(const VertexTree& tree, const DistanceCriterion& from,
                                        DistanceCriterion::Parts parts) {
        return DistanceCriterion::create(tree, std::move(parts), from.values_->reach);
    }
};

namespace {

double radians_of_pixels(const View& view, double pixels) { return pixels / pixels_per_radian(view); }

// One bit a node, for the nodes that the criterion is for.
bool are_of(const VertexTree& tree, const DistanceCriterion& criterion, std::span<const std::uint64_t> nodes) {
    return criterion.interior_count() == tree.interior_count() && nodes.size() == words_for(tree.interior_count());
}

} // namespace

Result<DistanceCriterion> extent_criterion(const VertexTree& tree, const View& view, double tolerance_pixels) {
    if (!(tolerance_pixels > 0)) return invalid_argument("The tolerance must be more than 0 pixels.");
    DistanceCriterion::Parts parts;
    parts.spheres = DistanceCriterion::Spheres::support;
    const double half_angle = std::min(radians_of_pixels(view, tolerance_pixels), std::numbers::pi) / 2;
    parts.switch_distance = {static_cast<float>(1 / std::sin(half_angle) - 1)};
    return DistanceCriterion::create(tree, std::move(parts));
}

Result<DistanceCriterion> displacement_criterion(const VertexTree& tree, const View& view, double tolerance_pixels) {
    if (!(tolerance_pixels > 0)) return invalid_argument("The tolerance must be more than 0 pixels.");
    DistanceCriterion::Parts parts;
    parts.spheres = DistanceCriterion::Spheres::support;
    const auto displacement = tree.displacement();
    parts.lengths.assign(displacement.begin(), displacement.end());
    const double half_angle = std::min(radians_of_pixels(view, tolerance_pixels), std::numbers::pi) / 2;
    const float switch_distance = static_cast<float>(1 / (2 * std::sin(half_angle)));
    parts.switch_distance = {switch_distance};
    if (std::ranges::find(displacement, 0.0f) != displacement.end()) { // a row of their own for what never moves
        parts.switch_distance = {DistanceCriterion::never_visible, switch_distance};
        for (const float moved : displacement) parts.classes.push_back(moved == 0 ? FoldClass{0, 0} : FoldClass{1, 1});
    }
    return DistanceCriterion::create(tree, std::move(parts));
}

Result<DistanceCriterion> keeping(const VertexTree& tree, const DistanceCriterion& criterion,
                                  std::span<const std::uint64_t> kept) {
    if (!are_of(tree, criterion, kept))
        return invalid_argument("The criterion, or what is to be kept, is not of this tree.");
    DistanceCriterion::Parts parts = criterion.parts();
    if (const auto done = keep(tree, parts, kept); !done) return done.error();
    return ChangedCriterion::of(tree, criterion, std::move(parts));
}

Result<DistanceCriterion> folding_hidden(const VertexTree& tree, const DistanceCriterion& criterion,
                                         std::span<const std::uint64_t> hidden) {
    if (!are_of(tree, criterion, hidden))
        return invalid_argument("The criterion, or what is hidden, is not of this tree.");
    DistanceCriterion::Parts parts = criterion.parts();
    if (parts.lit) return invalid_argument("Criteria with lights cannot fold what a picture hides.");
    if (const auto given = give_row(parts, tree.interior_count(), DistanceCriterion::never_visible, hidden); !given)
        return given.error();
    return ChangedCriterion::of(tree, criterion, std::move(parts));
}

Result<DistanceCriterion> costing_at_least(const VertexTree& tree, const DistanceCriterion& criterion,
                                           const Viewpoint& viewpoint, std::span<const float> costs) {
    const NodeId nodes = tree.interior_count();
    if (criterion.interior_count() != nodes || costs.size() != nodes)
        return invalid_argument("The criterion, or what nodes cost, is not of this tree.");
    DistanceCriterion::Parts parts = criterion.parts();
    if (parts.lit) return invalid_argument("Criteria with lights cannot have costs of a picture.");
    if (parts.silhouette_lengths.empty()) parts.silhouette_lengths = parts.lengths;
    for (NodeId node = 0; node < nodes; ++node) {
        const Sphere& sphere = sphere_of(tree, parts, node);
        if (parts.lengths.size() == node) parts.lengths.push_back(sphere.radius);
        if (parts.silhouette_lengths.size() == node) parts.silhouette_lengths.push_back(sphere.radius);
        const double gap = glm::length(glm::dvec3(sphere.centre) - viewpoint.eye) - static_cast<double>(sphere.radius) -
                           viewpoint.eye_spread;
        if (!(gap > 0)) continue; // costs more than anything
        const FoldClass rows = parts.classes.empty() ? FoldClass{} : parts.classes[node];
        const auto lengthen = [&](float& length, std::uint16_t row) {
            const float looked_at = parts.switch_distance[row * parts.eccentricity_bins];
            if (!(looked_at > 0) || looked_at >= DistanceCriterion::always_visible) return;
            const double needed = static_cast<double>(costs[node]) * gap / static_cast<double>(looked_at);
            length = std::max(length, static_cast<float>(std::min(needed, static_cast<double>(kept_length) / 2)));
        };
        lengthen(parts.lengths[node], rows.interior);
        lengthen(parts.silhouette_lengths[node], rows.silhouette);
    }
    return ChangedCriterion::of(tree, criterion, std::move(parts));
}

} // namespace unseen::vdtree
