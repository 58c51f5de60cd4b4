#include "measure/border_shifts.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <glm/geometric.hpp>

#include "measure/measurement.h"

namespace unseen::perception {

using namespace vdtree;
using namespace measurement;

BorderShifts::BorderShifts(const SoundTree& tree, const LeafTriangles& of_leaf)
    : tree_(tree), border_(tree, of_leaf), interior_(tree.interior_count()), positions_(tree.positions()),
      first_leaf_(tree.first_leaf()), leaf_end_(tree.leaf_end()), parents_(tree.parents()),
      triangles_(tree.triangles()), support_(tree.support_spheres()), levels_below_(interior_) {}

float BorderShifts::shift(NodeId node, std::span<const Index> crossing,
                          const FunctionRef<NodeId(Index leaf)>& stand_in) {
    if (border_.is_empty() || !(tree_.bounds()[node].flags & irregular_ring)) return 0;
    if (!(support_[node].radius > 0)) return 0; // all of it is at one point
    thread_local Scratch scratch;
    int below = 0;
    tree_.for_each_child(node, [&](NodeId child) {
        if (child < interior_) below = std::max(below, levels_below_[child] + 1);
    });
    const std::size_t looks = most_border_looks + border_looks_an_edge * (border_of(node).size() + crossing.size());
    scratch.looks_left = below < most_border_levels ? looks : 0;
    const float borders = distance_of_borders(node, crossing, stand_in, scratch);
    const float shift = turned_reach(node, crossing, borders, scratch);
    levels_below_[node] = static_cast<std::uint16_t>(scratch.looks_left > 0 ? below : most_border_levels);
    return shift;
}

std::span<const OpenBorder::End> BorderShifts::border_of(NodeId node) const {
    if (node >= interior_) return border_.at(node - interior_, node - interior_ + 1);
    return border_.at(first_leaf_[node], leaf_end_[node]);
}

// Down the tree, where the ring may be nearer than what was seen. False where that was too much: then only some edges
// have been looked at.
bool BorderShifts::look_at_border(NodeId top, BorderSide& side, Scratch& scratch) const {
    constexpr std::size_t few = 16; // edges, which are looked at one by one
    const auto look_at = [&](const OpenBorder::End& end) {
        side.look_at({leaf_place(end.leaf), leaf_place(end.other)}, leaf_place(end.opposite));
    };
    if (scratch.looks_left == 0) {
        const std::span<const OpenBorder::End> ends = border_of(top);
        const std::size_t count = std::min(ends.size(), few);
        for (std::size_t i = 0; i < count; ++i) look_at(ends[i * ends.size() / count]);
        return false;
    }
    std::vector<NodeId>& waiting = scratch.waiting;
    waiting.assign(1, top);
    while (!waiting.empty()) {
        const NodeId node = waiting.back();
        waiting.pop_back();
        const std::span<const OpenBorder::End> ends = border_of(node);
        const bool is_last = ends.size() <= few || node >= interior_;
        const std::size_t looks = is_last ? ends.size() + 1 : 1;
        scratch.looks_left -= std::min(scratch.looks_left, looks);
        if (is_last) {
            for (const OpenBorder::End& end : ends) look_at(end);
            continue;
        }
        if (scratch.looks_left == 0) return look_at_border(top, side, scratch);
        const Sphere& ring = tree_.bounds()[node].ring;
        if (side.may_be_nearer(ring.centre, ring.radius))
            tree_.for_each_child(node, [&](NodeId child) { waiting.push_back(child); });
    }
    return true;
}

float BorderShifts::distance_of_borders(NodeId node, std::span<const Index> crossing,
                                        const FunctionRef<NodeId(Index)>& stand_in, Scratch& scratch) const {
    const std::span<const OpenBorder::End> ends = border_of(node);
    if (ends.empty()) return 0;
    const glm::vec3 proxy = place(node);
    scratch.folded.clear();
    scratch.folded_alone.clear();
    for (const Index t : crossing) {
        for (std::size_t k = 0; k < 3; ++k) {
            if (!((border_.edges_of(t) >> k) & 1)) continue;
            Index in = triangles_[t][k], out = triangles_[t][(k + 1) % 3];
            if (!supports(node, in)) std::swap(in, out);
            if (!supports(node, in) || supports(node, out)) continue; // not here, or vanishes
            scratch.folded.push_back({proxy, place(stand_in(out))});
            scratch.folded_alone.push_back({proxy, leaf_place(out)});
        }
    }
    scratch.points.clear();
    const std::size_t count = std::min(ends.size(), most_border_ends);
    for (std::size_t i = 0; i < count; ++i) {
        const glm::vec3& p = leaf_place(ends[i * ends.size() / count].leaf);
        if (scratch.points.empty() || scratch.points.back() != p) scratch.points.push_back(p);
    }
    float largest = 0;
    for (std::vector<Segment>* folded : {&scratch.folded, &scratch.folded_alone}) {
        if (folded->empty()) folded->push_back({proxy, proxy}); // a border of the support alone shrinks to the proxy
        largest = std::max(largest, farthest_from(*folded, scratch.points));
    }
    // The other way round: the proxy, and points between it and the neighbours. Some edges alone are never too near.
    const auto look_from = [&](const glm::vec3& p) {
        BorderSide side(p);
        look_at_border(node, side, scratch);
        largest = std::max(largest, side.distance());
    };
    look_from(proxy);
    for (const auto& [a, b] : scratch.folded_alone)
        for (const float share : {0.25f, 0.5f, 0.75f}) look_from(a + share * (b - a));
    return largest;
}

// The nodes that may stand for a leaf while they are no larger than the node, and not for another leaf, too.
void BorderShifts::find_stand_ins(Index leaf, NodeId node, Index without, std::vector<NodeId>& nodes) const {
    nodes.assign(1, interior_ + leaf);
    for (NodeId up = parents_[nodes.back()];
         up != no_node && is_larger(node, up) && !supports(up, without) && nodes.size() < most_stand_ins;
         up = parents_[up])
        nodes.push_back(up);
}

// A folded sheet covers what lies beyond its folded border from both sides equally often: only triangles that have
// turned over, and others below them, lie there. In any cut, each such triangle has a largest node among its corners.
float BorderShifts::turned_reach(NodeId node, std::span<const Index> crossing, float least, Scratch& scratch) const {
    const glm::vec3 proxy = place(node);
    for (const Index t : crossing) {
        const Triangle& corners = triangles_[t];
        std::size_t k = 0;
        while (!supports(node, corners[k])) ++k;
        const Index next = corners[(k + 1) % 3], last = corners[(k + 2) % 3];
        if (supports(node, next) || supports(node, last)) continue; // vanishes
        const glm::vec3 a = leaf_place(corners[k]);
        const glm::vec3 normal = glm::cross(leaf_place(next) - a, leaf_place(last) - a);
        find_stand_ins(next, node, last, scratch.second);
        find_stand_ins(last, node, next, scratch.third);
        for (const NodeId second : scratch.second) {
            for (const NodeId third : scratch.third) {
                const glm::vec3 b = place(second) - proxy, c = place(third) - proxy, turned = glm::cross(b, c);
                if (!(glm::dot(turned, normal) < 0)) continue;
                // It reaches no farther than its least height.
                const float longest = std::max({glm::dot(b, b), glm::dot(c, c), glm::dot(c - b, c - b)});
                const float height = glm::length(turned) / std::sqrt(longest);
                if (height > least) least = std::max(least, std::min(height, reach_of(node, second, third, scratch)));
            }
        }
    }
    return least;
}

float BorderShifts::reach_of(NodeId a, NodeId b, NodeId c, Scratch& scratch) const {
    if (border_of(a).empty() && border_of(b).empty() && border_of(c).empty()) return 0;
    const glm::vec3 p = place(a), q = place(b), r = place(c);
    float reach = 0;
    for (const glm::vec3& at : {(p + q) * 0.5f, (q + r) * 0.5f, (r + p) * 0.5f, (p + q + r) / 3.0f}) {
        BorderSide side(at);
        for (const NodeId node : {a, b, c})
            if (!look_at_border(node, side, scratch)) return std::numeric_limits<float>::infinity();
        reach = std::max(reach, side.outside());
    }
    return reach;
}

} // namespace unseen::perception
