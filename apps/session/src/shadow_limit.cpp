#include "shadow_limit.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <glm/geometric.hpp>

namespace unseen::session {
namespace {

using vdtree::LightSource;

constexpr double infinity = std::numeric_limits<double>::infinity();
// Of distances from a light, within which its shadows count as alike: as large as at the far end, as bright as at the
// near one.
constexpr double distance_step = 1.25;
// What shadows fall on moves as well, by no more than what may move of what casts them.
constexpr double share_of_casters = 0.5;
constexpr double steps_per_octave = 2;
constexpr double least_kept = 1.0 / 3;

double distance_to_segment(glm::dvec3 p, glm::dvec3 a, glm::dvec3 b) {
    const glm::dvec3 along = b - a;
    const double squared = glm::dot(along, along);
    const double t = squared > 0 ? std::clamp(glm::dot(p - a, along) / squared, 0.0, 1.0) : 0;
    return glm::length(p - (a + t * along));
}

double of_directional(const LightSource& light, const perception::ShadowEdges& edges, const FrameBall& object,
                      const FrameBall& scene, glm::dvec3 eye) {
    const double reach = glm::length(object.centre - scene.centre) + scene.radius + object.radius;
    const double nearest =
        distance_to_segment(eye, object.centre, object.centre - reach * light.direction) - object.radius;
    return nearest > 0 ? nearest * edges.widest_unseen(light.intensity) : 0;
}

double of_placed(const LightSource& light, const perception::ShadowEdges& edges, const FrameBall& object,
                 const FrameBall& scene, glm::dvec3 eye) {
    const glm::dvec3 way = object.centre - light.position;
    const double middle = glm::length(way), first = middle - object.radius;
    if (!(first > 0)) return 0;
    const glm::dvec3 along = way / middle;
    const double last = std::max(glm::length(light.position - scene.centre) + scene.radius, middle + object.radius);
    // At a distance r, the cone around the object is within so much of r from its axis.
    const double spread = 2 * std::sin(std::asin(std::min(object.radius / middle, 1.0)) / 2);
    double least = infinity;
    for (double from = first; from < last; from *= distance_step) {
        const double to = std::min(from * distance_step, last), ratio = light.distance / from;
        const double nearest =
            distance_to_segment(eye, light.position + from * along, light.position + to * along) - to * spread;
        if (!(nearest > 0)) return 0;
        least = std::min(least, nearest * edges.widest_unseen(light.intensity * ratio * ratio) * first / to);
    }
    return least;
}

} // namespace

double unseen_shift(const vdtree::Lighting& lighting, const perception::ShadowEdges& edges, const FrameBall& object,
                    const FrameBall& scene, glm::dvec3 eye) {
    double least = infinity;
    for (const LightSource& light : lighting.lights) {
        if (!light.casts_shadow) continue;
        const double own = light.kind == LightSource::Kind::directional
                               ? of_directional(light, edges, object, scene, eye)
                               : of_placed(light, edges, object, scene, eye);
        least = own >= 0 ? std::min(least, own) : 0; // 0 for NaN
    }
    return share_of_casters * least;
}

std::vector<float> outline_shifts(const vdtree::VertexTree& tree, std::span<const float> moved,
                                  std::span<const vdtree::NormalSlabs> facing, const vdtree::Lighting* lighting) {
    const vdtree::NodeId nodes = tree.interior_count();
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

double steady_limit(double limit, double before) {
    if (!(limit > 0)) return 0;
    if (!std::isfinite(limit)) return limit;
    if (before <= limit && before >= least_kept * limit) return before;
    return std::exp2(std::floor(std::log2(limit) * steps_per_octave) / steps_per_octave);
}

std::vector<std::uint64_t> beyond(std::span<const float> shifts, double limit) {
    constexpr std::size_t word = 64;
    std::vector<std::uint64_t> bits((shifts.size() + word - 1) / word, 0);
    for (std::size_t i = 0; i < shifts.size(); ++i)
        if (!(static_cast<double>(shifts[i]) <= limit)) bits[i / word] |= std::uint64_t{1} << (i % word);
    return bits;
}

} // namespace unseen::session
