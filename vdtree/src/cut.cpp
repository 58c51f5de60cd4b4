#include <vdtree/cut.h>

#include <algorithm>
#include <bit>
#include <cassert>
#include <queue>

namespace unseen::vdtree {

namespace {

// Nodes are handed to the callbacks in batches of at most this many: enough to hide the call, little enough for the
// first-level cache.
constexpr std::size_t batch_size = 1024;

bool test_bit(const std::vector<std::uint64_t>& bits, NodeId i) { return (bits[i >> 6] >> (i & 63)) & 1; }
void set_bit(std::vector<std::uint64_t>& bits, NodeId i) { bits[i >> 6] |= std::uint64_t{1} << (i & 63); }
void clear_bit(std::vector<std::uint64_t>& bits, NodeId i) { bits[i >> 6] &= ~(std::uint64_t{1} << (i & 63)); }

// Asks the callbacks about nodes, batch by batch: whether a node can be seen, and the cost of folding it.
class NodeTester {
public:
    NodeTester(const VertexTree& tree, FoldCriterion criterion, VisibilityTest visibility)
        : tree_(tree), criterion_(criterion), visibility_(visibility) {}

    // Costs of `nodes`, valid until the next call; 0 for those that cannot be seen.
    std::span<const float> operator()(std::span<const NodeId> nodes) {
        costs_.assign(nodes.size(), 0.0f);
        for (std::size_t begin = 0; begin < nodes.size(); begin += batch_size) {
            const auto batch = nodes.subspan(begin, std::min(batch_size, nodes.size() - begin));
            test(batch, std::span(costs_).subspan(begin, batch.size()));
        }
        return costs_;
    }
    std::uint64_t tests() const { return tests_; }

private:
    void test(std::span<const NodeId> nodes, std::span<float> costs) {
        if (!visibility_) {
            criterion_(tree_, nodes, costs);
            tests_ += nodes.size();
            return;
        }
        seen_.assign(nodes.size(), Visibility::partly);
        visibility_(tree_, nodes, seen_);
        visible_.clear();
        for (std::size_t i = 0; i < nodes.size(); ++i)
            if (seen_[i] != Visibility::out) visible_.push_back(nodes[i]);
        visible_costs_.assign(visible_.size(), 0.0f);
        criterion_(tree_, visible_, visible_costs_);
        tests_ += visible_.size();
        for (std::size_t i = 0, j = 0; i < nodes.size(); ++i)
            if (seen_[i] != Visibility::out) costs[i] = visible_costs_[j++];
    }

    const VertexTree& tree_;
    FoldCriterion criterion_;
    VisibilityTest visibility_;
    std::vector<float> costs_, visible_costs_;
    std::vector<NodeId> visible_;
    std::vector<Visibility> seen_;
    std::uint64_t tests_ = 0;
};

// What a criterion asks for: the nodes to unfold, and the largest cost among those left folded under them.
struct Decision {
    std::vector<std::uint64_t> unfolded;
    float max_fold_cost = 0;
};

bool is_below_threshold(float cost) { return cost <= 1; } // false for NaN: unfold

// Top-down, a level at a time, so that the callbacks get whole batches.
Decision decide_by_threshold(const VertexTree& tree, NodeTester& test) {
    Decision decision{std::vector<std::uint64_t>((tree.interior_count() + 63) / 64), 0};
    std::vector<NodeId> level{VertexTree::root()}, next;
    while (!level.empty()) {
        const auto costs = test(level);
        next.clear();
        for (std::size_t i = 0; i < level.size(); ++i) {
            if (is_below_threshold(costs[i])) {
                decision.max_fold_cost = std::max(decision.max_fold_cost, costs[i]);
                continue;
            }
            set_bit(decision.unfolded, level[i]);
            tree.for_each_child(level[i], [&](NodeId child) {
                if (!tree.is_leaf(child)) next.push_back(child);
            });
        }
        level.swap(next);
    }
    return decision;
}

// Unfolds the node of the largest cost, ties by the lower number, while the budget holds. A node that does not fit ends
// the walk: taking a cheaper one instead would leave the largest cost as it is.
Decision decide_by_budget(const VertexTree& tree, NodeTester& test, Index budget) {
    struct Candidate {
        float cost;
        NodeId node;
        bool operator<(const Candidate& other) const {
            return cost != other.cost ? cost < other.cost : node > other.node;
        }
    };
    Decision decision{std::vector<std::uint64_t>((tree.interior_count() + 63) / 64), 0};
    const auto first = tree.first_triangle();
    std::priority_queue<Candidate> candidates;
    std::vector<NodeId> children;
    const auto add = [&](std::span<const NodeId> nodes) {
        const auto costs = test(nodes);
        for (std::size_t i = 0; i < nodes.size(); ++i) {
            const float cost = costs[i] >= 0 ? costs[i] : std::numeric_limits<float>::infinity();
            candidates.push({cost, nodes[i]});
        }
    };
    const NodeId root = VertexTree::root();
    add({&root, 1});
    std::uint64_t triangles = 0;
    while (!candidates.empty() && candidates.top().cost > 0) {
        const NodeId node = candidates.top().node;
        const std::uint64_t added = first[node + 1] - first[node];
        if (triangles + added > budget) break;
        candidates.pop();
        triangles += added;
        set_bit(decision.unfolded, node);
        children.clear();
        tree.for_each_child(node, [&](NodeId child) {
            if (!tree.is_leaf(child)) children.push_back(child);
        });
        add(children);
    }
    decision.max_fold_cost = candidates.empty() ? 0 : candidates.top().cost;
    return decision;
}

// Sorts the triangles of an extracted mesh by their input triangle, so that the input's groups and materials are runs again.
void group_by_range(const Cut& cut, Mesh& mesh) {
    const VertexTree& tree = cut.tree();
    const auto first = tree.first_triangle();
    std::vector<std::pair<Index, Index>> order; // input triangle, triangle of the mesh
    order.reserve(mesh.triangles.size());
    for (NodeId node = 0; node < tree.interior_count(); ++node) {
        if (!cut.is_unfolded(node)) continue;
        for (Index t = first[node]; t < first[node + 1]; ++t)
            order.emplace_back(tree.source_triangles()[t], static_cast<Index>(order.size()));
    }
    std::sort(order.begin(), order.end());
    std::vector<Triangle> sorted(order.size());
    for (std::size_t i = 0; i < order.size(); ++i) sorted[i] = mesh.triangles[order[i].second];
    mesh.triangles = std::move(sorted);
    for (const MeshRange& range : tree.ranges()) {
        const auto place = [&](std::uint64_t source) {
            const auto found = std::partition_point(order.begin(), order.end(),
                                                    [&](const auto& entry) { return entry.first < source; });
            return static_cast<std::uint64_t>(found - order.begin());
        };
        MeshRange left = range;
        left.first_triangle = place(range.first_triangle);
        left.triangle_count = place(range.first_triangle + range.triangle_count) - left.first_triangle;
        if (left.triangle_count > 0) mesh.ranges.push_back(std::move(left));
    }
}

} // namespace

Cut::Cut(const VertexTree& tree)
    : tree_(&tree), unfolded_((tree.interior_count() + 63) / 64), proxy_(tree.leaf_count(), VertexTree::root()) {}

bool Cut::is_unfolded(NodeId node) const noexcept { return !tree_->is_leaf(node) && test_bit(unfolded_, node); }

bool Cut::is_active(NodeId node) const noexcept {
    if (is_unfolded(node)) return false;
    const NodeId parent = tree_->parents()[node];
    return parent == no_node || test_bit(unfolded_, parent);
}

void Cut::set_unfolded(NodeId node) {
    set_bit(unfolded_, node);
    triangle_count_ += tree_->first_triangle()[node + 1] - tree_->first_triangle()[node];
    indices_stale_ = true;
}

void Cut::set_folded(NodeId node) {
    clear_bit(unfolded_, node);
    triangle_count_ -= tree_->first_triangle()[node + 1] - tree_->first_triangle()[node];
    indices_stale_ = true;
}

// Makes the leaves of a node stand for the node itself.
void Cut::assign(NodeId node) {
    if (tree_->is_leaf(node)) {
        proxy_[node - tree_->interior_count()] = node;
        return;
    }
    std::fill(proxy_.begin() + tree_->first_leaf()[node], proxy_.begin() + tree_->leaf_end()[node], node);
}

bool Cut::unfold(NodeId node) {
    assert(!tree_->is_leaf(node) && (is_active(node) || is_unfolded(node)));
    if (test_bit(unfolded_, node)) return false;
    set_unfolded(node);
    tree_->for_each_child(node, [&](NodeId child) { assign(child); });
    return true;
}

bool Cut::fold(NodeId node) {
    assert(!tree_->is_leaf(node));
    if (!test_bit(unfolded_, node)) return false;
    tree_->for_each_child(node, [&]([[maybe_unused]] NodeId child) { assert(!is_unfolded(child)); });
    set_folded(node);
    assign(node);
    return true;
}

bool Cut::unfold_ancestors(NodeId node) {
    std::vector<NodeId> folded;
    for (NodeId up = tree_->parents()[node]; up != no_node && !test_bit(unfolded_, up); up = tree_->parents()[up])
        folded.push_back(up);
    for (auto up = folded.rbegin(); up != folded.rend(); ++up) unfold(*up);
    return !folded.empty();
}

bool Cut::fold_subtree(NodeId node) {
    if (tree_->is_leaf(node) || !test_bit(unfolded_, node)) return false;
    for (NodeId below = node; below < tree_->subtree_end()[node]; ++below)
        if (test_bit(unfolded_, below)) set_folded(below);
    assign(node);
    return true;
}

void Cut::unfold_all() {
    for (NodeId node = 0; node < tree_->interior_count(); ++node) set_bit(unfolded_, node);
    for (Index leaf = 0; leaf < tree_->leaf_count(); ++leaf) proxy_[leaf] = tree_->interior_count() + leaf;
    triangle_count_ = tree_->triangle_count();
    indices_stale_ = true;
}

void Cut::fold_all() { fold_subtree(VertexTree::root()); }

AdjustStats Cut::adjust(FoldCriterion criterion, const AdjustOptions& options) {
    NodeTester test(*tree_, criterion, options.visibility);
    const Decision decision = options.triangle_budget ? decide_by_budget(*tree_, test, *options.triangle_budget)
                                                      : decide_by_threshold(*tree_, test);
    AdjustStats stats;
    stats.node_tests = test.tests();
    stats.max_fold_cost = decision.max_fold_cost;

    // Replays the difference. Node numbers ascend from parents to children: unfolds run upward through them, so every
    // node is active when its turn comes, and folds run downward.
    for (std::size_t word = 0; word < unfolded_.size(); ++word) {
        for (std::uint64_t bits = decision.unfolded[word] & ~unfolded_[word]; bits; bits &= bits - 1) {
            unfold(static_cast<NodeId>(word * 64 + static_cast<std::size_t>(std::countr_zero(bits))));
            ++stats.unfolds;
        }
    }
    for (std::size_t word = unfolded_.size(); word-- > 0;) {
        for (std::uint64_t bits = unfolded_[word] & ~decision.unfolded[word]; bits;) {
            const int highest = 63 - std::countl_zero(bits);
            fold(static_cast<NodeId>(word * 64 + static_cast<std::size_t>(highest)));
            bits &= ~(std::uint64_t{1} << highest);
            ++stats.folds;
        }
    }
    stats.triangles = triangle_count_;
    return stats;
}

Mesh extract_mesh(const Cut& cut) {
    const VertexTree& tree = cut.tree();
    const auto indices = cut.indices();
    Mesh mesh;
    std::vector<Index> vertex_of_node(tree.node_count(), no_node);
    std::vector<NodeId> used;
    mesh.triangles.resize(cut.triangle_count());
    for (std::size_t i = 0; i < indices.size(); ++i) {
        Index& vertex = vertex_of_node[indices[i]];
        if (vertex == no_node) {
            vertex = static_cast<Index>(used.size());
            used.push_back(indices[i]);
        }
        mesh.triangles[i / 3][i % 3] = vertex;
    }
    mesh.positions.reserve(used.size());
    for (const NodeId node : used) mesh.positions.push_back(tree.origin() + glm::dvec3(tree.positions()[node]));
    const auto gather = [&](auto values, auto& out) {
        if (values.empty()) return;
        out.reserve(used.size());
        for (const NodeId node : used) out.push_back(values[node]);
    };
    gather(tree.normals(), mesh.normals);
    gather(tree.colours(), mesh.colours);
    gather(tree.uvs(), mesh.uvs);
    if (!tree.ranges().empty()) group_by_range(cut, mesh);
    return mesh;
}

std::span<const NodeId> Cut::indices() const {
    if (!indices_stale_) return indices_;
    indices_.resize(std::size_t{3} * triangle_count_);
    const auto first = tree_->first_triangle();
    const auto triangles = tree_->triangles();
    NodeId* out = indices_.data();
    for (std::size_t word = 0; word < unfolded_.size(); ++word) {
        for (std::uint64_t bits = unfolded_[word]; bits; bits &= bits - 1) {
            const NodeId node = static_cast<NodeId>(word * 64 + static_cast<std::size_t>(std::countr_zero(bits)));
            for (Index t = first[node]; t < first[node + 1]; ++t)
                for (const Index leaf : triangles[t]) *out++ = proxy_[leaf];
        }
    }
    indices_stale_ = false;
    return indices_;
}

} // namespace unseen::vdtree
