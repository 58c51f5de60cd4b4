#include "shadow_outlines.h"

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
            if (!tree.is_place(child)) shifts[node] = std::max(shifts[node], shifts[child]);
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
            if (tree.is_place(child)) return;
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

namespace {

// The share of the invisible shift that the eye may use up by moving before a criterion is made anew.
constexpr double share_left_to_motion = 0.7;
// More nodes than this share beyond those that have to be are not kept.
constexpr double most_kept_too_many = 0.25;

vdtree::Lighting in_world(vdtree::Lighting lighting, const Object& object) {
    const vdtree::Similarity& placement = object.placement;
    for (vdtree::LightSource& light : lighting.lights) {
        light.direction = glm::normalize(placement.rotation * light.direction);
        light.position = placement.to_world(object.tree.origin() + light.position);
        light.distance *= placement.scale;
    }
    return lighting;
}

std::vector<Standing> all_standing(const SceneShadows& all) {
    std::vector<Standing> standing;
    for (std::size_t i = 0; i < all.scene.objects.size(); ++i) {
        const Object& object = all.scene.objects[i];
        Standing one{&object, all.caches[i]->light_bounds.get()};
        const bool shows_through = object.tree.bounds()[vdtree::VertexTree::root()].flags & vdtree::translucent_ring;
        one.hides_back_faces = !shows_through && object.tree.closedness() != vdtree::Closedness::open;
        standing.push_back(one);
    }
    for (const Object& object : all.scene.backdrop) standing.push_back({&object});
    return standing;
}

// Under moving lights every receiver counts as lit: testing them in each frame costs more than it saves.
LitReceivers lit_by(const ShadowReceivers& receivers, vdtree::Lighting lighting, bool stands_still) {
    LitReceivers lit{std::move(lighting), {}};
    for (const vdtree::LightSource& light : lit.lighting.lights)
        if (light.casts_shadow)
            lit.of_lights.push_back(stands_still ? receivers.find_lit(light)
                                                 : std::vector<bool>(receivers.balls().size(), true));
    return lit;
}

} // namespace

Result<std::shared_ptr<const perception::ShadowEdges>> edges_of(Sight& sight, const Decision& decision,
                                                                const Key& key) {
    if (!casts_shadows(sight) || !is_perceptual(decision.test)) return std::shared_ptr<const perception::ShadowEdges>();
    // A highlight may be all there is on what is otherwise black.
    const double ambient = sight.lighting->specular > 0 ? 0 : sight.lighting->ambient;
    const SceneShadows::EdgesKey edges_key{key.lens, ambient, key.farthest_gaze_px, key.csf};
    SceneShadows& all = sight.scene_shadows;
    std::erase_if(all.known_edges, [](const auto& known) { return known.edges.expired(); });
    const auto found = std::ranges::find(all.known_edges, edges_key, &SceneShadows::KnownEdges::key);
    if (found != all.known_edges.end()) return all.last_edges = found->edges.lock();
    auto made = perception::ShadowEdges::create(sight.view, test_options(sight, key), ambient);
    if (!made) return made.error();
    all.last_edges = std::make_shared<const perception::ShadowEdges>(std::move(*made));
    all.known_edges.push_back({edges_key, all.last_edges});
    return all.last_edges;
}

std::shared_ptr<const ShadowReach> reach_of(Sight& sight, const Decision& decision,
                                            const std::shared_ptr<const perception::ShadowEdges>& edges) {
    SceneShadows& all = sight.scene_shadows;
    std::shared_ptr<const ShadowReach>& reach = sight.memory.reach;
    const vdtree::Lighting lighting = in_world(*sight.lighting, sight.object);
    std::span<const vdtree::Plane> window;
    if (decision.request.purpose != Purpose::mesh) window = *sight.window;
    if (reach && reach->holds_for(lighting, edges.get(), sight.view.eye, window)) return reach;
    if (!all.receivers) all.receivers.emplace(all_standing(all));
    if (!all.lit || !is_alike(all.lit->lighting, lighting))
        all.lit = lit_by(*all.receivers, lighting, sight.lights->stands_still());
    const bool moves = reach && !reach->is_of(sight.view.eye, window); // the first view may be the only one
    reach = std::make_shared<const ShadowReach>(*all.receivers, *all.lit, edges, sight.view.eye, window, moves);
    return reach;
}

bool find_shadowing_outlines(Sight& sight, const Decision& decision, const std::shared_ptr<const KeptCriterion>& base) {
    const vdtree::VertexTree& tree = sight.object.tree;
    const vdtree::DistanceCriterion::Parts& parts = base->criterion.parts();
    const bool is_measured = base->key.test == FoldTest::error; // what folds move, and where they face in any cut
    const auto still = is_measured ? sight.lighting : nullptr;
    const double threshold = decision.request.goal.cost;
    ShadowState& state = shadow_of(sight);
    const bool is_new = state.of != base || state.lighting != still || state.threshold != threshold;
    if (is_new) {
        state = {base, still, {}, nullptr, threshold, {}, nullptr};
        state.shifts = is_measured ? outline_shifts(tree, parts.silhouette_lengths, parts.facing, still.get())
                                   : outline_shifts(tree, tree.displacement(), {}, nullptr);
    }
    const auto reach = reach_of(sight, decision, base->edges);
    const bool is_first = !state.reach;
    if (state.reach == reach) return false;
    state.reach = reach;
    if (!is_first) {
        const auto needed = shadowing_outlines(sight.object, state.shifts, *reach, threshold);
        const auto most = static_cast<std::size_t>((1 + most_kept_too_many) * static_cast<double>(count(needed)));
        if (contains(state.kept, needed) && count(state.kept) <= most) return false;
    }
    const double share = reach->moves() ? share_left_to_motion : 1;
    auto kept = shadowing_outlines(sight.object, state.shifts, *reach, share * threshold);
    const bool is_other = is_first || kept != state.kept;
    state.kept = std::move(kept);
    return is_other;
}

Result<std::shared_ptr<const vdtree::DistanceCriterion>>
keep_outlines(Sight& sight, const Decision& decision, const std::shared_ptr<const KeptCriterion>& base) {
    ShadowState& state = shadow_of(sight);
    if (!find_shadowing_outlines(sight, decision, base) && state.criterion) return state.criterion;
    if (count(state.kept) == 0) {
        state.criterion = {base, &base->criterion};
        return state.criterion;
    }
    auto kept = vdtree::keeping(sight.object.tree, base->criterion, state.kept);
    if (!kept) return kept.error();
    state.criterion = std::make_shared<const vdtree::DistanceCriterion>(std::move(*kept));
    return state.criterion;
}

} // namespace unseen::session
