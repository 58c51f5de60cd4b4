#include "tree/node_check.h"

#include <tbb/parallel_reduce.h>

#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/tree_shape.h>
#include <unseen/vdtree/internal/vectors.h>

#include "tree/mask_pool.h"

namespace unseen::vdtree {

namespace {

bool are_finite(std::span<const float> values) {
    return std::ranges::all_of(values, [](float value) { return std::isfinite(value); });
}
// Of a struct of floats.
template <class T>
bool has_finite_floats(const T& value) {
    static_assert(sizeof(T) % sizeof(float) == 0);
    return are_finite({reinterpret_cast<const float*>(&value), sizeof(T) / sizeof(float)});
}

constexpr const char* links_fault = "contradicts its neighbours in the tree.";
constexpr const char* wedges_fault = "has wedges that are not its own.";
constexpr const char* triangles_fault = "has triangles of another node.";
constexpr const char* corner_fault = "has a triangle with a corner out of range or twice.";
constexpr const char* vanishing_fault = "has a triangle that does not vanish there.";

// That the sets of nodes and of wedges agree on the node's wedges.
const char* fault_in_wedges(const TreeLinks& tree, NodeId node) {
    if (!tree.has_seams()) return nullptr;
    for (WedgeId w = tree.first_wedge_of(node); w < tree.first_wedge_of(node + 1); ++w)
        if (tree.node_of_wedge(w) != node) return wedges_fault;
    return nullptr;
}

// Calls f for every child; null or what is wrong.
template <class F>
const char* walk_children(const TreeGeometry& g, NodeId node, F&& f) {
    const TreeLinks tree = links_of(g);
    const NodeId interior = tree.interior();
    const Index leaves = tree.leaves(), end = g.leaf_end[node];
    const NodeId skip = g.subtree_end[node];
    if (!(g.first_leaf[node] < end && end <= leaves && node < skip && skip <= interior)) return links_fault;
    NodeId child = node + 1;
    for (Index leaf = g.first_leaf[node]; leaf < end;) {
        const bool inner = child < skip && g.first_leaf[child] == leaf;
        const NodeId id = inner ? child : tree.place_of_leaf(leaf);
        if (id >= g.parents.size() || g.parents[id] != node) return links_fault;
        if (const char* fault = fault_in_wedges(tree, id)) return fault;
        if (inner) {
            if (!(leaf < g.leaf_end[child] && g.leaf_end[child] <= end && child < g.subtree_end[child] &&
                  g.subtree_end[child] <= skip))
                return links_fault;
            leaf = g.leaf_end[child];
            child = g.subtree_end[child];
        } else {
            if (id < interior || tree.first_wedge_of(id) != tree.wedge_of_leaf(leaf)) return wedges_fault;
            leaf += tree.first_wedge_of(id + 1) - tree.first_wedge_of(id);
            if (leaf > end) return wedges_fault;
        }
        if (const char* fault = f(id)) return fault;
    }
    return child == skip ? nullptr : links_fault;
}

// Whether a triangle with different corners has two in the leaves [begin, end), and no two in one child of those whose
// first leaves are given, ascending.
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
    const TreeLinks tree = links_of(g);
    if (g.parents[0] != no_node || g.first_leaf[0] != 0 || g.leaf_end[0] != tree.leaves() ||
        g.subtree_end[0] != interior)
        return links_fault;
    if (const char* fault = fault_in_wedges(tree, 0)) return fault;
    return g.first_triangle[0] == 0 && g.first_triangle[interior] == g.triangles.size() ? nullptr : triangles_fault;
}

// Counters that run on, and as many members as there should be.
bool is_counted(std::span<const RankWord> set, std::size_t size, std::size_t members) {
    if (set.size() != size / 32 + 1) return false;
    std::uint64_t before = 0;
    for (const RankWord& word : set) {
        if (word.before != before) return false;
        before += static_cast<std::uint64_t>(std::popcount(word.bits));
    }
    return before == members && set.back().bits >> (size % 32) == 0;
}

const char* section_against_wedges(const TreeGeometry& g) noexcept {
    const std::size_t nodes = g.parents.size(), wedges = g.positions.size(), interior = g.first_leaf.size();
    if (g.several.empty()) {
        if (!g.extra_wedges.empty() || !g.further.empty() || !g.leaf_ranks.empty() || !g.wedge_ranks.empty())
            return "several";
        return wedges == nodes ? nullptr : "positions";
    }
    if (wedges < nodes || wedges >= no_node) return "positions";
    const auto& extra = g.extra_wedges;
    if (extra.empty() || extra[0] != 0 || extra[extra.size() - 1] != wedges - nodes ||
        std::adjacent_find(extra.begin(), extra.end(), std::greater_equal<>()) != extra.end())
        return "extra_wedges";
    if (!is_counted(g.several, nodes, extra.size() - 1)) return "several";
    if (!is_counted(g.further, wedges, wedges - nodes) || is_in(g.further, 0)) return "further";
    const Index k = rank_in(g.several, static_cast<Index>(interior));
    if (g.wedge_ranks.size() != extra[k] + k) return "wedge_ranks";
    return g.leaf_ranks.size() == wedges - interior - extra[k] ? nullptr : "leaf_ranks";
}

const char* section_against_needs(const TreeGeometry& g) noexcept {
    if (g.needing.empty()) {
        if (!g.first_need.empty()) return "first_need";
        return g.needs.empty() ? nullptr : "needs";
    }
    const std::size_t interior = g.first_leaf.size();
    const auto& first = g.first_need;
    if (first.empty() || first[0] != 0 || first[first.size() - 1] != g.needs.size() ||
        std::adjacent_find(first.begin(), first.end(), std::greater_equal<>()) != first.end())
        return "first_need";
    if (!is_counted(g.needing, interior, first.size() - 1)) return "needing";
    const auto is_known = [&](NodeId need) { return 0 < (need & ~joined_need) && (need & ~joined_need) < interior; };
    return std::ranges::all_of(g.needs, is_known) ? nullptr : "needs";
}

const char* fault_in_links(const TreeGeometry& g, NodeId node) {
    const TreeLinks tree = links_of(g);
    const NodeId interior = tree.interior();
    const std::size_t leaves = tree.leaves();
    // In depth-first order, the triangles of the node come before those of its children's subtrees.
    Index before = g.first_triangle[node + 1];
    if (g.first_triangle[node] > before || before > g.triangles.size()) return triangles_fault;
    thread_local std::vector<Index> child_starts; // kept: most nodes have two children
    child_starts.clear();
    const char* fault = walk_children(g, node, [&](NodeId child) -> const char* {
        child_starts.push_back(child < interior ? g.first_leaf[child]
                                                : tree.first_wedge_of(child) - tree.wedge_of_leaf(0));
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
        if (tri[0] >= leaves || tri[1] >= leaves || tri[2] >= leaves || uses_a_vertex_twice(tri)) return corner_fault;
        if (!vanishes(tri, g.first_leaf[node], g.leaf_end[node], child_starts)) return vanishing_fault;
    }
    return nullptr;
}

const char* fault_in_values(const TreeGeometry& g, NodeId node) noexcept {
    const TreeLinks tree = links_of(g);
    for (WedgeId w = tree.first_wedge_of(node); w < tree.first_wedge_of(node + 1); ++w)
        if (!has_finite_floats(g.positions[w]) || (!g.colours.empty() && !has_finite_floats(g.colours[w])) ||
            (!g.uvs.empty() && !has_finite_floats(g.uvs[w])))
            return "has a value that is not finite.";
    if (node >= g.bounds.size()) return nullptr;
    for (const Sphere& sphere : {g.bounds[node].ring, g.support_spheres[node]})
        if (!has_finite_floats(sphere) || sphere.radius < 0) return "has a bounding sphere that is none.";
    return nullptr;
}

std::string fault_in_sections(const TreeGeometry& g, const TreeLuminance& l) {
    const auto all_finite = [](const auto& values) {
        return std::ranges::all_of(values, [](const auto& value) { return has_finite_floats(value); });
    };
    for (const auto& [holds, name] : {std::pair(all_finite(g.positions), "positions"),
                                      {all_finite(g.colours), "colours"},
                                      {all_finite(g.uvs), "uvs"},
                                      {all_finite(g.support_spheres), "support_spheres"},
                                      {all_finite(g.displacement), "displacement"}})
        if (!holds) return "Section " + std::string(name) + " has a value that is not finite.";
    for (const NodeBounds& b : g.bounds) {
        if (!has_finite_floats(b.ring)) return "Section bounds has a value that is not finite.";
        if (b.ring.radius < 0) return "A bounding sphere has a negative radius.";
    }
    for (const Sphere& s : g.support_spheres)
        if (!(s.radius >= 0)) return "A bounding sphere has a negative radius.";
    for (const std::uint32_t at : g.mask_at)
        if (at >= g.mask_records.size() - most_mask_bytes) return "A mask begins behind the last record.";
    const auto ends_early = [](const PackedRange& range) { return range.hi < range.lo; };
    if (std::ranges::any_of(l.support_range, ends_early) || std::ranges::any_of(l.ring_range, ends_early))
        return "A luminance range ends before it begins.";
    if (std::ranges::any_of(g.ring_texture, ends_early))
        return "A range of the texture's luminance ends before it begins.";
    if (std::ranges::any_of(g.displacement, [](float moved) { return moved < 0; }))
        return "A displacement is negative.";
    // Everybody looks for leaves by these.
    const auto is_outside = [&](Index rank) { return rank >= g.leaf_ranks.size(); };
    if (std::ranges::any_of(g.leaf_ranks, is_outside) || std::ranges::any_of(g.wedge_ranks, is_outside))
        return "A wedge's rank is out of range.";
    // Users index their own arrays with these.
    if (std::ranges::any_of(g.source_vertices, [&](Index v) { return v >= g.source_vertex_count; }))
        return "A source vertex is out of range.";
    if (std::ranges::any_of(g.source_triangles, [&](Index t) { return t >= g.triangles.size() + g.dropped_triangles; }))
        return "A source triangle is out of range.";
    return {};
}

std::string fault_in_fold_weights(const TreeGeometry& g) {
    const auto& w = g.fold_weights;
    if (w.size() > 1 && w.size() != g.first_leaf.size()) return "Section fold_weights has the wrong length.";
    for (std::size_t node = 0; node < w.size(); ++node) {
        if (!is_fold_weight(w[node]) || (node > 0 && w[node] == never_folds) ||
            (node > 0 && !(g.parents[node] < node && w[node] <= w[g.parents[node]])))
            return "The weight of the folds of node " + std::to_string(node) + " is out of range.";
    }
    if (!std::ranges::all_of(g.locked_positions, is_finite<double>))
        return "Section locked_positions has a value that is not finite.";
    return {};
}

NodeChecks::NodeChecks(const TreeGeometry& g, const TreeLuminance& l)
    : g_(g), l_(l), sound_(std::make_unique<std::atomic<std::uint64_t>[]>((g.first_leaf.size() + 63) / 64)) {}

// The file does not change, so that several threads may look at one node.
bool NodeChecks::is_in_order(NodeId node) {
    std::atomic<std::uint64_t>& word = sound_[node >> 6];
    const std::uint64_t bit = std::uint64_t{1} << (node & 63);
    if (word.load(std::memory_order_relaxed) & bit) return true;
    if (fault_in_links(g_, node)) return false;
    if (node == VertexTree::root() && fault_in_values(g_, node)) return false;
    if (walk_children(g_, node, [&](NodeId child) { return fault_in_values(g_, child); })) return false;
    word.fetch_or(bit, std::memory_order_relaxed);
    return true;
}

Result<void> NodeChecks::check_all() {
    if (all_sound_.load(std::memory_order_acquire)) return {};
    const auto damaged = [](const std::string& what) {
        return Error{ErrorCode::malformed_data, what + " Build the tree again from its mesh."};
    };
    // The lowest one, whichever thread gets where first.
    constexpr NodeId grain = 4096; // nodes
    using Range = tbb::blocked_range<NodeId>;
    const auto lowest = [](NodeId a, NodeId b) { return std::min(a, b); };
    const TaskOrder order;
    const NodeId node = tbb::parallel_reduce(
        Range(0, static_cast<NodeId>(g_.first_leaf.size()), grain), no_node,
        [&](const Range& range, NodeId found) {
            const TaskOrder::Task task(order);
            for (NodeId n = range.begin(); n < range.end() && n < found; ++n)
                if (!is_in_order(n)) return n;
            return found;
        },
        lowest);
    if (node != no_node) return damaged("Node " + std::to_string(node) + " of the mapped tree is damaged.");
    if (const std::string fault = fault_in_sections(g_, l_); !fault.empty())
        return damaged("The mapped tree is damaged. " + fault);
    all_sound_.store(true, std::memory_order_release);
    return {};
}

} // namespace unseen::vdtree
