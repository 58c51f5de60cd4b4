#include "build/triangle_rings.h"

#include <limits>
#include <numeric>

#include "build/spatial_order.h"

namespace unseen::vdtree {

namespace {

constexpr Index no_corner = std::numeric_limits<Index>::max();
// The cosine of the angle by which a merge may turn a triangle, squared: 78 degrees. What turns farther has folded over
// in all but name, and the next merge would finish it.
constexpr float least_cosine_squared = 0.0432f;
// A triangle with less area than this share of its sides' squares has no direction that floats could tell.
constexpr float least_area_share = 1e-5f;

float length_squared(glm::vec3 v) { return glm::dot(v, v); }

} // namespace

TriangleRings::TriangleRings(const Contraction& c) : c_(c), clusters_(static_cast<Index>(c.live.size())) {
    if (c.live.size() > 0) {
        const Box box = box_around(c.live.places);
        centre_ = box.low + box.size() * 0.5;
    }
    const std::size_t tags = clusters_ + c.outside.size();
    places_.reserve(tags);
    for (const glm::dvec3& place : c.live.places) places_.emplace_back(place - centre_);
    for (const auto& leaf : c.outside) places_.emplace_back(leaf.place - centre_);
    joined_to_.resize(tags);
    std::iota(joined_to_.begin(), joined_to_.end(), Index{0});
}

Index TriangleRings::tag_of(Index corner) const {
    return corner & LiveTriangle::is_outside ? clusters_ + (corner & ~LiveTriangle::is_outside) : corner;
}

void TriangleRings::start() {
    lists_.assign(places_.size(), {no_corner, no_corner});
    for (const LiveTriangle& t : c_.triangles) {
        Ring ring{{}, {no_corner, no_corner, no_corner}, t.normal};
        for (std::size_t k = 0; k < 3; ++k) ring.corners[k] = short_root_of(tag_of(t.corners[k]));
        if (uses_a_vertex_twice(ring.corners)) continue;
        rings_.push_back(ring);
        for (Index k = 0; k < 3; ++k)
            if (ring.corners[k] < clusters_) append(ring.corners[k], static_cast<Index>(rings_.size() - 1) * 4 + k);
    }
}

void TriangleRings::append(Index tag, Index corner) {
    List& list = lists_[tag];
    if (list.first == no_corner) list.first = corner;
    else rings_[list.last / 4].next[list.last % 4] = corner;
    list.last = corner;
}

bool TriangleRings::turns(Index a, Index b, glm::dvec3 place) {
    const glm::vec3 to(place - centre_);
    return turns_around(a, b, to) || turns_around(b, a, to);
}

// Of the triangles around `tag`, without those that vanish. Takes out of its list those that have vanished.
bool TriangleRings::turns_around(Index tag, Index other, glm::vec3 place) {
    const glm::vec3 from = places_[tag];
    Index before = no_corner;
    for (Index corner = lists_[tag].first; corner != no_corner;) {
        Ring& ring = rings_[corner / 4];
        const Index k = corner % 4, next = ring.next[k];
        Index &u = ring.corners[k == 2 ? 0 : k + 1], &v = ring.corners[k == 0 ? 2 : k - 1];
        u = short_root_of(u), v = short_root_of(v);
        if (u == v || u == tag || v == tag) {
            if (before == no_corner) lists_[tag].first = next;
            else rings_[before / 4].next[before % 4] = next;
            if (next == no_corner) lists_[tag].last = before;
        } else if (u != other && v != other) {
            const glm::vec3 at_u = places_[u], side = places_[v] - at_u;
            const glm::vec3 was = glm::cross(side, from - at_u), now = glm::cross(side, place - at_u);
            const float sides = length_squared(side) + length_squared(from - at_u);
            const bool has_direction = length_squared(was) > least_area_share * least_area_share * sides * sides;
            const float same = glm::dot(was, now);
            if (has_direction &&
                !(same > 0 && same * same > least_cosine_squared * length_squared(was) * length_squared(now)))
                return true;
            if (glm::dot(now, ring.normal) < 0 && !(glm::dot(was, ring.normal) < 0)) return true;
            before = corner;
        } else {
            before = corner;
        }
        corner = next;
    }
    return false;
}

void TriangleRings::unite(Index a, Index b, glm::dvec3 place) {
    joined_to_[b] = a;
    places_[a] = glm::vec3(place - centre_);
    if (!is_started()) return;
    const List of_b = lists_[b];
    if (of_b.first == no_corner) return;
    List& list = lists_[a];
    if (list.first == no_corner) {
        list = of_b;
    } else {
        rings_[list.last / 4].next[list.last % 4] = of_b.first;
        list.last = of_b.last;
    }
}

std::vector<LiveTriangle> TriangleRings::left(std::span<const Index> tag_of_cluster) const {
    std::vector<Index> number(places_.size(), no_corner);
    for (Index cluster = 0; cluster < tag_of_cluster.size(); ++cluster) number[tag_of_cluster[cluster]] = cluster;
    for (Index tag = clusters_; tag < number.size(); ++tag) number[tag] = LiveTriangle::is_outside | (tag - clusters_);
    std::vector<LiveTriangle> out;
    const auto add = [&](const std::array<Index, 3>& tags, glm::vec3 normal) {
        LiveTriangle t{{}, normal};
        for (std::size_t k = 0; k < 3; ++k) t.corners[k] = number[root_of(tags[k])];
        if (!uses_a_vertex_twice(t.corners)) out.push_back(t);
    };
    for (const Ring& ring : rings_) add(ring.corners, ring.normal);
    if (is_started()) return out;
    for (const LiveTriangle& t : c_.triangles)
        add({tag_of(t.corners[0]), tag_of(t.corners[1]), tag_of(t.corners[2])}, t.normal);
    return out;
}

} // namespace unseen::vdtree
