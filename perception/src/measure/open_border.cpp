#include "measure/open_border.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include <glm/geometric.hpp>

namespace unseen::perception {

using namespace vdtree;

namespace {

// Nodes that may touch a border. The tree does not say so for nodes of coincident vertices alone, whose merging moves
// nothing: they are like the node above them.
std::vector<bool> nodes_near_border(const SoundTree& tree) {
    std::vector<bool> is_near(tree.interior_count());
    for (NodeId node = 0; node < tree.interior_count(); ++node) {
        const bool is_point = node > 0 && tree.support_spheres()[node].radius == 0;
        is_near[node] = (tree.bounds()[node].flags & irregular_ring) || (is_point && is_near[tree.parents()[node]]);
    }
    return is_near;
}

// Leaves at one position are one place, named after the first of them.
struct Places {
    std::vector<Index> leaves; // those at the same place side by side
    std::vector<Index> of;     // by leaf

    explicit Places(std::span<const glm::vec3> positions) : leaves(positions.size()), of(positions.size()) {
        std::iota(leaves.begin(), leaves.end(), Index{0});
        std::sort(leaves.begin(), leaves.end(), [&](Index a, Index b) {
            const glm::vec3 &p = positions[a], &q = positions[b];
            if (p.x != q.x) return p.x < q.x;
            if (p.y != q.y) return p.y < q.y;
            return p.z != q.z ? p.z < q.z : a < b;
        });
        for (std::size_t i = 0; i < leaves.size(); ++i) {
            const bool is_first = i == 0 || positions[leaves[i - 1]] != positions[leaves[i]];
            of[leaves[i]] = is_first ? leaves[i] : of[leaves[i - 1]];
        }
    }
};

// An edge from a place.
struct Edge {
    Index to, opposite; // places: the other end, and the triangle's third corner
    Index triangle;
    unsigned number; // of the triangle's edges
};

void add_edges(Index from, Index triangle, const std::array<Index, 3>& at, std::vector<Edge>& edges) {
    if (at[0] == at[1] || at[1] == at[2] || at[2] == at[0]) return;
    for (unsigned k = 0; k < 3; ++k) {
        const unsigned next = (k + 1) % 3;
        if (at[k] == from) edges.push_back({at[next], at[(k + 2) % 3], triangle, k});
        if (at[next] == from) edges.push_back({at[k], at[(k + 2) % 3], triangle, k});
    }
}

// Marks those of an odd number of triangles; triangles with the same corners are one.
void mark_odd(std::vector<Edge>& edges, std::vector<std::uint8_t>& edges_of) {
    std::sort(edges.begin(), edges.end(),
              [](const Edge& a, const Edge& b) { return a.to != b.to ? a.to < b.to : a.opposite < b.opposite; });
    for (std::size_t begin = 0, next = 0; begin < edges.size(); begin = next) {
        bool is_odd = false;
        for (; next < edges.size() && edges[next].to == edges[begin].to; ++next)
            if (next == begin || edges[next].opposite != edges[next - 1].opposite) is_odd = !is_odd;
        for (std::size_t k = begin; k < next && is_odd; ++k)
            edges_of[edges[k].triangle] |= static_cast<std::uint8_t>(1u << edges[k].number);
    }
}

} // namespace

OpenBorder::OpenBorder(const SoundTree& tree, const LeafTriangles& of_leaf) {
    if (!(tree.bounds()[VertexTree::root()].flags & irregular_ring)) return;
    find_edges(tree, of_leaf);
    collect_ends(tree);
    if (ends_.empty()) edges_of_ = {};
}

void OpenBorder::find_edges(const SoundTree& tree, const LeafTriangles& of_leaf) {
    const NodeId interior = tree.interior_count();
    const std::vector<bool> is_near = nodes_near_border(tree);
    const Places places(tree.positions().subspan(interior));
    edges_of_.assign(tree.triangles().size(), 0);
    std::vector<Edge> edges;
    for (std::size_t first = 0, end = 0; first < places.leaves.size(); first = end) {
        const Index here = places.of[places.leaves[first]];
        while (end < places.leaves.size() && places.of[places.leaves[end]] == here) ++end;
        const std::span<const Index> at_place = std::span(places.leaves).subspan(first, end - first);
        if (std::none_of(at_place.begin(), at_place.end(),
                         [&](Index leaf) { return is_near[tree.parents()[interior + leaf]]; }))
            continue;
        edges.clear();
        for (const Index leaf : at_place) {
            for (const Index triangle : of_leaf.around(leaf)) {
                const Triangle& t = tree.triangles()[triangle];
                add_edges(here, triangle, {places.of[t[0]], places.of[t[1]], places.of[t[2]]}, edges);
            }
        }
        mark_odd(edges, edges_of_);
    }
}

void OpenBorder::collect_ends(const SoundTree& tree) {
    for (Index triangle = 0; triangle < tree.triangles().size(); ++triangle) {
        const Triangle& t = tree.triangles()[triangle];
        for (unsigned k = 0; k < 3; ++k) {
            if (!((edges_of_[triangle] >> k) & 1)) continue;
            ends_.push_back({t[k], t[(k + 1) % 3], t[(k + 2) % 3]});
            ends_.push_back({t[(k + 1) % 3], t[k], t[(k + 2) % 3]});
        }
    }
    std::sort(ends_.begin(), ends_.end());
    first_end_.assign(std::size_t{tree.leaf_count()} + 1, 0);
    for (const End& end : ends_) ++first_end_[end.leaf + 1];
    for (std::size_t i = 1; i < first_end_.size(); ++i) first_end_[i] += first_end_[i - 1];
}

void BorderSide::take(const Segment& edge, const glm::vec3& inside, const glm::vec3& nearest, float squared) {
    if (squared < (1 - rounding) * squared_) squared_ = squared, nearest_ = nearest, inward_ = glm::vec3(0);
    // Which side it is, none of the edges that meet there tells alone.
    const glm::vec3 along = edge.b - edge.a, beside = inside - edge.a;
    const float length = glm::dot(along, along);
    const glm::vec3 across = length > 0 ? beside - glm::dot(beside, along) / length * along : beside;
    if (const float width = glm::length(across); width > 0) inward_ += across / width;
}

float BorderSide::distance() const { return std::sqrt(squared_); }

float BorderSide::outside() const { return glm::dot(point_ - nearest_, inward_) < 0 ? distance() : 0; }

float farthest_from(std::span<const Segment> segments, std::span<const glm::vec3> points) {
    float farthest = 0;
    for (const glm::vec3& p : points) {
        float nearest = std::numeric_limits<float>::infinity();
        for (const Segment& segment : segments) {
            if (nearest <= farthest) break; // which this point does not raise
            const glm::vec3 way = p - segment.nearest_to(p);
            nearest = std::min(nearest, glm::dot(way, way));
        }
        farthest = std::max(farthest, nearest);
    }
    return std::sqrt(farthest);
}

} // namespace unseen::perception
