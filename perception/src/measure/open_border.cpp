#include "measure/open_border.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <glm/geometric.hpp>

namespace unseen::perception {

using namespace vdtree;

OpenBorder::OpenBorder(const SoundTree& tree, const LeafTriangles& of_leaf) {
    if (tree.bounds()[VertexTree::root()].flags & irregular_ring) find_edges(tree, of_leaf);
}

void OpenBorder::find_edges(const SoundTree& tree, const LeafTriangles& of_leaf) {
    const NodeId interior = tree.interior_count();
    const std::span<const glm::vec3> positions = tree.positions().subspan(interior);
    const std::span<const Triangle> triangles = tree.triangles();
    // Nodes that may touch a border. Of coincident vertices alone, whose merging moves nothing, the tree does not say:
    // they are as the node above them.
    std::vector<bool> is_near(interior);
    for (NodeId node = 0; node < interior; ++node) {
        const bool is_point = node > 0 && tree.support_spheres()[node].radius == 0;
        is_near[node] = (tree.bounds()[node].flags & irregular_ring) || (is_point && is_near[tree.parents()[node]]);
    }
    std::vector<Index> leaves(tree.leaf_count()); // those at the same position side by side
    std::iota(leaves.begin(), leaves.end(), Index{0});
    std::sort(leaves.begin(), leaves.end(), [&](Index a, Index b) {
        const glm::vec3 &p = positions[a], &q = positions[b];
        if (p.x != q.x) return p.x < q.x;
        if (p.y != q.y) return p.y < q.y;
        return p.z != q.z ? p.z < q.z : a < b;
    });
    std::vector<Index> place(leaves.size()); // the first leaf at the position
    for (std::size_t i = 0; i < leaves.size(); ++i) {
        const bool is_first = i == 0 || positions[leaves[i - 1]] != positions[leaves[i]];
        place[leaves[i]] = is_first ? leaves[i] : place[leaves[i - 1]];
    }

    edges_of_.assign(triangles.size(), 0);
    struct Edge {
        Index to, opposite; // places: the other end, and the triangle's third corner
        Index triangle;
        unsigned number; // of the triangle's edges
    };
    std::vector<Edge> edges;
    for (std::size_t first = 0, end = 0; first < leaves.size(); first = end) {
        const Index here = place[leaves[first]];
        while (end < leaves.size() && place[leaves[end]] == here) ++end;
        const std::span<const Index> at_place = std::span(leaves).subspan(first, end - first);
        if (std::none_of(at_place.begin(), at_place.end(),
                         [&](Index leaf) { return is_near[tree.parents()[interior + leaf]]; }))
            continue;
        edges.clear();
        for (const Index leaf : at_place) {
            for (const Index triangle : of_leaf.around(leaf)) {
                const Triangle& t = triangles[triangle];
                const Index at[3] = {place[t[0]], place[t[1]], place[t[2]]};
                if (at[0] == at[1] || at[1] == at[2] || at[2] == at[0]) continue;
                for (unsigned k = 0; k < 3; ++k) {
                    const unsigned next = (k + 1) % 3;
                    if (at[k] == here) edges.push_back({at[next], at[(k + 2) % 3], triangle, k});
                    if (at[next] == here) edges.push_back({at[k], at[(k + 2) % 3], triangle, k});
                }
            }
        }
        std::sort(edges.begin(), edges.end(),
                  [](const Edge& a, const Edge& b) { return a.to != b.to ? a.to < b.to : a.opposite < b.opposite; });
        for (std::size_t begin = 0, next = 0; begin < edges.size(); begin = next) {
            bool is_odd = false;
            for (; next < edges.size() && edges[next].to == edges[begin].to; ++next)
                if (next == begin || edges[next].opposite != edges[next - 1].opposite) is_odd = !is_odd;
            for (std::size_t k = begin; k < next && is_odd; ++k)
                edges_of_[edges[k].triangle] |= static_cast<std::uint8_t>(1u << edges[k].number);
        }
    }
    for (Index triangle = 0; triangle < triangles.size(); ++triangle) {
        for (unsigned k = 0; k < 3; ++k) {
            if (!((edges_of_[triangle] >> k) & 1)) continue;
            const Index a = triangles[triangle][k], b = triangles[triangle][(k + 1) % 3];
            const Index opposite = triangles[triangle][(k + 2) % 3];
            ends_.push_back({a, b, opposite});
            ends_.push_back({b, a, opposite});
        }
    }
    if (ends_.empty()) {
        edges_of_ = {};
        return;
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
