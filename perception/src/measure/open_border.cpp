#include "measure/open_border.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <glm/geometric.hpp>

namespace unseen::perception {

using namespace vdtree;

OpenBorder::OpenBorder(const SoundTree& tree, const LeafTriangles& of_leaf) {
    if (tree.bounds()[VertexTree::root()].flags & irregular_ring) find_edges(tree, of_leaf);
}

std::span<const OpenBorder::End> OpenBorder::at(Index first_leaf, Index leaf_end) const {
    const auto from = [&](Index leaf) { return std::lower_bound(ends_.begin(), ends_.end(), End{leaf, 0}); };
    const auto begin = from(first_leaf), end = from(leaf_end);
    return std::span(ends_).subspan(static_cast<std::size_t>(begin - ends_.begin()),
                                    static_cast<std::size_t>(end - begin));
}

void OpenBorder::find_edges(const SoundTree& tree, const LeafTriangles& of_leaf) {
    const NodeId interior = tree.interior_count();
    const std::span<const glm::vec3> positions = tree.positions().subspan(interior);
    const std::span<const Triangle> triangles = tree.triangles();
    // Leaves where an edge may end that is not as it is inside a surface, those at the same position side by side.
    std::vector<Index> leaves;
    for (Index leaf = 0; leaf < tree.leaf_count(); ++leaf)
        if (tree.bounds()[tree.parents()[interior + leaf]].flags & irregular_ring) leaves.push_back(leaf);
    std::sort(leaves.begin(), leaves.end(), [&](Index a, Index b) {
        const glm::vec3 &p = positions[a], &q = positions[b];
        if (p.x != q.x) return p.x < q.x;
        if (p.y != q.y) return p.y < q.y;
        return p.z != q.z ? p.z < q.z : a < b;
    });
    const auto is_same_place = [&](Index a, Index b) { return positions[a] == positions[b]; };
    std::vector<Index> place(tree.leaf_count()); // the first leaf at the position
    for (Index leaf = 0; leaf < place.size(); ++leaf) place[leaf] = leaf;
    for (std::size_t i = 1; i < leaves.size(); ++i)
        if (is_same_place(leaves[i - 1], leaves[i])) place[leaves[i]] = place[leaves[i - 1]];

    edges_of_.assign(triangles.size(), 0);
    struct Edge {
        Index to, opposite; // places: the other end, and the triangle's third corner
        Index triangle;
        unsigned number; // of the triangle's edges
    };
    std::vector<Edge> edges;
    for (std::size_t i = 0; i < leaves.size();) {
        const Index here = place[leaves[i]];
        edges.clear();
        for (; i < leaves.size() && place[leaves[i]] == here; ++i) {
            for (const Index triangle : of_leaf.around(leaves[i])) {
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
        for (std::size_t begin = 0, end = 0; begin < edges.size(); begin = end) {
            bool is_odd = false;
            for (; end < edges.size() && edges[end].to == edges[begin].to; ++end)
                if (end == begin || edges[end].opposite != edges[end - 1].opposite) is_odd = !is_odd;
            for (std::size_t k = begin; k < end && is_odd; ++k)
                edges_of_[edges[k].triangle] |= static_cast<std::uint8_t>(1u << edges[k].number);
        }
    }
    for (Index triangle = 0; triangle < triangles.size(); ++triangle) {
        for (unsigned k = 0; k < 3; ++k) {
            if (!((edges_of_[triangle] >> k) & 1)) continue;
            const Index a = triangles[triangle][k], b = triangles[triangle][(k + 1) % 3];
            ends_.push_back({a, b});
            ends_.push_back({b, a});
        }
    }
    std::sort(ends_.begin(), ends_.end());
    if (ends_.empty()) edges_of_ = {};
}

float farthest_from(std::span<const Segment> segments, std::span<const glm::vec3> points) {
    float farthest = 0;
    for (const glm::vec3& p : points) {
        float nearest = std::numeric_limits<float>::infinity();
        for (const auto& [a, b] : segments) {
            const glm::vec3 ab = b - a, ap = p - a;
            const float squared = glm::dot(ab, ab), along = glm::dot(ap, ab);
            const float share = squared > 0 ? std::clamp(along / squared, 0.0f, 1.0f) : 0.0f;
            const glm::vec3 way = ap - share * ab;
            nearest = std::min(nearest, glm::dot(way, way));
        }
        farthest = std::max(farthest, nearest);
    }
    return std::sqrt(farthest);
}

} // namespace unseen::perception
