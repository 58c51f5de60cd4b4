#include "node_check.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

namespace unseen::vdtree {

namespace {

bool is_finite(const float* values, int count) {
    for (int i = 0; i < count; ++i)
        if (!std::isfinite(values[i])) return false;
    return true;
}

constexpr const char* links_fault = "contradicts its neighbours in the tree.";
constexpr const char* triangles_fault = "has triangles of another node.";
constexpr const char* corner_fault = "has a triangle with a corner out of range or twice.";
constexpr const char* vanishing_fault = "has a triangle that does not vanish there.";

// Calls f for every child; null or what is wrong.
template <class F>
const char* walk_children(const TreeGeometry& g, NodeId node, F&& f) {
    const NodeId interior = static_cast<NodeId>(g.first_leaf.size());
    const Index leaves = static_cast<Index>(g.parents.size() - interior);
    const Index end = g.leaf_end[node];
    const NodeId skip = g.subtree_end[node];
    if (!(g.first_leaf[node] < end && end <= leaves && node < skip && skip <= interior)) return links_fault;
    NodeId child = node + 1;
    for (Index leaf = g.first_leaf[node]; leaf < end;) {
        const bool inner = child < skip && g.first_leaf[child] == leaf;
        const NodeId id = inner ? child : interior + leaf;
        if (g.parents[id] != node) return links_fault;
        if (inner) {
            if (!(leaf < g.leaf_end[child] && g.leaf_end[child] <= end && child < g.subtree_end[child] &&
                  g.subtree_end[child] <= skip))
                return links_fault;
            leaf = g.leaf_end[child];
            child = g.subtree_end[child];
        } else {
            ++leaf;
        }
        if (const char* fault = f(id)) return fault;
    }
    return child == skip ? nullptr : links_fault;
}

// Whether a triangle with different corners has two in the leaves [begin, end), and no two in one child of those whose first
// leaves are given, ascending.
bool vanishes(Triangle t, Index begin, Index end, std::span<const Index> child_starts) {
    std::sort(t.begin(), t.end());
    const auto inside = [&](Index leaf) { return begin <= leaf && leaf < end; };
    const auto apart = [&](Index a, Index b) { // a < b
        const auto next = std::upper_bound(child_starts.begin(), child_starts.end(), a);
        return next != child_starts.end() && *next <= b;
    };
    int pairs = 0; // of neighbours in the sorted order; leaves in a node have none between them that is outside
    for (std::size_t k = 0; k < 2; ++k) {
        if (!inside(t[k]) || !inside(t[k + 1])) continue;
        if (!apart(t[k], t[k + 1])) return false;
        ++pairs;
    }
    return pairs > 0;
}

} // namespace

const char* fault_in_root(const TreeGeometry& g) noexcept {
    const std::size_t interior = g.first_leaf.size();
    if (g.parents[0] != no_node || g.first_leaf[0] != 0 || g.leaf_end[0] != g.parents.size() - interior ||
        g.subtree_end[0] != interior)
        return links_fault;
    return g.first_triangle[0] == 0 && g.first_triangle[interior] == g.triangles.size() ? nullptr : triangles_fault;
}

const char* fault_in_links(const TreeGeometry& g, NodeId node) {
    const NodeId interior = static_cast<NodeId>(g.first_leaf.size());
    const std::size_t leaves = g.parents.size() - interior;
    // In depth-first order, the triangles of the node come before those of its children's subtrees.
    Index before = g.first_triangle[node + 1];
    if (g.first_triangle[node] > before || before > g.triangles.size()) return triangles_fault;
    thread_local std::vector<Index> child_starts; // kept: most nodes have two children
    child_starts.clear();
    const char* fault = walk_children(g, node, [&](NodeId child) -> const char* {
        child_starts.push_back(child < interior ? g.first_leaf[child] : child - interior);
        if (child >= interior) return nullptr;
        const Index end = g.first_triangle[g.subtree_end[child]];
        if (g.first_triangle[child] != before || end < before || end > g.triangles.size()) return triangles_fault;
        before = end;
        return nullptr;
    });
    if (fault) return fault;
    if (child_starts.size() < 2) return links_fault;
    for (Index t = g.first_triangle[node]; t < g.first_triangle[node + 1]; ++t) {
        const Triangle& tri = g.triangles[t];
        if (tri[0] >= leaves || tri[1] >= leaves || tri[2] >= leaves || tri[0] == tri[1] || tri[1] == tri[2] ||
            tri[2] == tri[0])
            return corner_fault;
        if (!vanishes(tri, g.first_leaf[node], g.leaf_end[node], child_starts)) return vanishing_fault;
    }
    return nullptr;
}

const char* fault_in_values(const TreeGeometry& g, NodeId node) noexcept {
    const bool drawable = is_finite(&g.positions[node].x, 3) && (g.colours.empty() || is_finite(&g.colours[node].x, 4)) &&
                          (g.uvs.empty() || is_finite(&g.uvs[node].x, 2));
    if (!drawable) return "has a value that is not finite.";
    if (node >= g.bounds.size()) return nullptr;
    for (const Sphere* s : {&g.bounds[node].ring, &g.support_spheres[node]})
        if (!(is_finite(&s->centre.x, 3) && s->radius >= 0 && std::isfinite(s->radius)))
            return "has a bounding sphere that is none.";
    return nullptr;
}

NodeChecks::NodeChecks(const TreeGeometry& g)
    : g_(g), sound_(std::make_unique<std::atomic<std::uint64_t>[]>((g.first_leaf.size() + 63) / 64)) {}

// The file does not change, so that several threads may look at one node.
bool NodeChecks::look(NodeId node) {
    const char* fault = fault_in_links(g_, node);
    if (!fault && node == VertexTree::root()) fault = fault_in_values(g_, node);
    if (!fault) fault = walk_children(g_, node, [&](NodeId child) { return fault_in_values(g_, child); });
    if (fault) {
        NodeId none = no_node;
        damaged_.compare_exchange_strong(none, node, std::memory_order_relaxed);
        return false;
    }
    sound_[node >> 6].fetch_or(std::uint64_t{1} << (node & 63), std::memory_order_relaxed);
    return true;
}

} // namespace unseen::vdtree
