#include "shadow_limit.h"

#include <algorithm>
#include <bit>

#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/normal_mask.h>

namespace unseen::session {
namespace {

using vdtree::LightSource;
using vdtree::NodeId;

// What shadows fall on moves as well, by no more than what may move of what casts them.
constexpr double share_of_casters = 0.5;
constexpr NodeId looked_at_together = 16; // nodes with one limit: what lies behind all of them

} // namespace

std::vector<float> outline_shifts(const vdtree::VertexTree& tree, std::span<const float> moved,
                                  std::span<const vdtree::NormalSlabs> facing, const vdtree::Lighting* lighting) {
    const NodeId nodes = tree.interior_count();
    const auto is_outline = [&](vdtree::NodeId node) {
        const vdtree::NodeBounds& bounds = tree.bounds()[node];
        if (!lighting || facing.empty() || (bounds.flags & vdtree::irregular_ring)) return true;
        return std::any_of(lighting->lights.begin(), lighting->lights.end(), [&](const LightSource& light) {
            if (!light.casts_shadow) return false;
            // A directional light is so far away that it sees the ring under no angle.
            constexpr float far_away = 1e6f; // radii
            const glm::dvec3 way = light.position - glm::dvec3(bounds.ring.centre);
            const bool has_place = light.kind != LightSource::Kind::directional;
            const glm::dvec3 towards = has_place ? glm::normalize(way) : light.direction;
            const float distance =
                has_place ? static_cast<float>(glm::length(way)) : far_away * std::max(bounds.ring.radius, 1e-30f);
            const vdtree::Facing seen = vdtree::facing(facing[node], glm::vec3(towards), distance, bounds.ring.radius);
            return seen != vdtree::Facing::front && seen != vdtree::Facing::back;
        });
    };
    std::vector<float> shifts(nodes, 0);
    for (vdtree::NodeId node = nodes; node-- > 0;) {
        if (is_outline(node)) shifts[node] = std::max(shifts[node], moved[node]);
        tree.for_each_child(node, [&](vdtree::NodeId child) {
            if (!tree.is_leaf(child)) shifts[node] = std::max(shifts[node], shifts[child]);
        });
    }
    return shifts;
}

std::vector<std::uint64_t> shadowing_outlines(const Object& object, std::span<const float> shifts,
                                              const ShadowReach& reach, double share) {
    constexpr NodeId word = 64;
    const vdtree::VertexTree& tree = object.tree;
    std::vector<std::uint64_t> kept((tree.interior_count() + word - 1) / word, 0);
    struct Subtree {
        NodeId node, end;
    };
    std::vector<Subtree> open = {{vdtree::VertexTree::root(), tree.interior_count()}};
    while (!open.empty()) {
        const Subtree subtree = open.back();
        open.pop_back();
        const vdtree::Sphere ring = tree.bounds()[subtree.node].ring;
        const WorldSphere sphere{object.placement.to_world(tree.origin() + glm::dvec3(ring.centre)),
                                 object.placement.scale * cast_radii * static_cast<double>(ring.radius)};
        const double limit = share * share_of_casters * reach.unseen_shift(sphere) / object.placement.scale;
        const auto moves = [&](NodeId node) { return !(static_cast<double>(shifts[node]) <= limit); };
        if (!moves(subtree.node)) continue; // nor does anything below
        const bool is_small = subtree.end - subtree.node <= looked_at_together;
        for (NodeId node = subtree.node; node < (is_small ? subtree.end : subtree.node + 1); ++node)
            if (moves(node)) kept[node / word] |= std::uint64_t{1} << (node % word);
        if (is_small) continue;
        const std::size_t first = open.size();
        tree.for_each_child(subtree.node, [&](NodeId child) {
            if (tree.is_leaf(child)) return;
            if (open.size() > first) open.back().end = child;
            open.push_back({child, subtree.end});
        });
    }
    return kept;
}

bool contains(std::span<const std::uint64_t> all, std::span<const std::uint64_t> some) {
    return std::equal(all.begin(), all.end(), some.begin(), some.end(),
                      [](std::uint64_t a, std::uint64_t b) { return (b & ~a) == 0; });
}

std::size_t count(std::span<const std::uint64_t> bits) {
    std::size_t sum = 0;
    for (const std::uint64_t word : bits) sum += static_cast<std::size_t>(std::popcount(word));
    return sum;
}

} // namespace unseen::session
