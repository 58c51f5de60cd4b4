#include <vdtree/cut.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cassert>
#include <cmath>
#include <numeric>
#include <string>

#include "cut/budget.h"
#include "cut/cut_follower.h"
#include "cut/decide_tree.h"
#include <vdtree/internal/finite.h>
#include "cut/index_buffer.h"
#include "cut/kernel/prefetch.h"
#include "tree/unchecked_links.h"

namespace unseen::vdtree {

namespace {

// Nodes are handed to the callbacks in batches of at most this many: enough to hide the call, little enough for the
// first-level cache.
constexpr std::size_t batch_size = 1024;

// Patching the index buffer around one change costs about as much as gathering so many triangles.
constexpr std::size_t triangles_per_patch = 60;
std::size_t few_changes(Index triangles) { return std::max<std::size_t>(triangles / triangles_per_patch, 16); }

// All leaves in order are gone through in the time in which those of so many times fewer changes are found.
constexpr std::size_t leaves_per_change = 16;

// Revisions of one cut never come to those of another one.
std::uint64_t first_revision() {
    static std::atomic<std::uint64_t> cuts{0};
    return ++cuts << 40;
}

bool test_bit(const std::vector<std::uint64_t>& bits, NodeId i) { return (bits[i >> 6] >> (i & 63)) & 1; }
void set_bit(std::vector<std::uint64_t>& bits, NodeId i) { bits[i >> 6] |= std::uint64_t{1} << (i & 63); }
void clear_bit(std::vector<std::uint64_t>& bits, NodeId i) { bits[i >> 6] &= ~(std::uint64_t{1} << (i & 63)); }

// What the caller's own callbacks say: the costs of folding nodes, 0 where these cannot be seen; what is no number is infinite.
class CallbackCosts final : public CostSource {
public:
    CallbackCosts(const VertexTree& tree, const FoldCriterion& criterion, const VisibilityTest& visibility)
        : tree_(tree), criterion_(criterion), visibility_(visibility) {}

    void find_costs(std::span<const NodeId> nodes, const NodeCosts& found) const override {
        std::fill_n(found.unfolded, (nodes.size() + 63) / 64, 0);
        std::fill_n(found.cost, nodes.size(), 0.0f);
        for (std::size_t begin = 0; begin < nodes.size(); begin += batch_size) {
            const auto batch = nodes.subspan(begin, std::min(batch_size, nodes.size() - begin));
            test(batch, std::span(found.cost + begin, batch.size()));
        }
        for (std::size_t i = 0; i < nodes.size(); ++i) {
            float& cost = found.cost[i];
            cost = cost >= 0 ? cost : std::numeric_limits<float>::infinity();
            found.unfolded[i / 64] |= std::uint64_t{cost > 1} << (i % 64);
        }
        if (found.seen_cost != found.cost) std::copy_n(found.cost, nodes.size(), found.seen_cost);
    }
    std::uint64_t tests() const { return tests_; }

private:
    void test(std::span<const NodeId> nodes, std::span<float> costs) const {
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
    const FoldCriterion& criterion_;
    const VisibilityTest& visibility_;
    mutable std::vector<float> visible_costs_; // scratch
    mutable std::vector<NodeId> visible_;
    mutable std::vector<Visibility> seen_;
    mutable std::uint64_t tests_ = 0;
};

// What a criterion asks for: the nodes to unfold, and the largest cost among those left folded under them.
struct Decision {
    std::vector<std::uint64_t> unfolded;
    float max_fold_cost = 0;
};

// Top-down, many nodes at once, so that the callbacks get whole batches.
Decision decide_by_threshold(const VertexTree& tree, const CostSource& source) {
    Decision decision;
    std::vector<float> costs;
    const auto decide = [&](std::span<const NodeId> nodes, std::uint64_t* unfolded) {
        costs.resize(nodes.size());
        source.find_costs(nodes, {costs.data(), costs.data(), unfolded});
        for (std::size_t i = 0; i < nodes.size(); ++i)
            if (costs[i] <= 1 || !tree.is_sound(nodes[i]))
                decision.max_fold_cost = std::max(decision.max_fold_cost, costs[i]);
    };
    decision.unfolded = TreeDecider().run(tree, decide, [](std::span<const NodeId>) {});
    return decision;
}

Decision decide_by_budget(const VertexTree& tree, const CostSource& source, Index budget) {
    const VertexTree* const trees[] = {&tree};
    const CostSource* const sources[] = {&source};
    BudgetDecision decision = decide_budget(trees, sources, {.triangles = budget});
    return {std::move(decision.unfolded.front()), decision.max_seen_cost};
}

// The corners of the cut's triangles in the order of the input, in which groups and materials are runs; these are appended to `ranges`. (The
// index buffer's order follows from the history of the cut.)
std::vector<NodeId> corners_by_range(const Cut& cut, std::vector<MeshRange>& ranges) {
    const VertexTree& tree = cut.tree();
    const auto& links = unchecked_links(tree); // of unfolded nodes, which are sound
    const auto first = links.first_triangle;
    std::vector<std::pair<Index, Index>> order; // input triangle, triangle of the tree
    order.reserve(cut.triangle_count());
    for (NodeId node = 0; node < tree.interior_count(); ++node) {
        if (!cut.is_unfolded(node)) continue;
        for (Index t = first[node]; t < first[node + 1]; ++t) order.emplace_back(tree.source_triangles()[t], t);
    }
    std::sort(order.begin(), order.end());
    std::vector<NodeId> corners;
    corners.reserve(3 * order.size());
    for (const auto& [source, triangle] : order)
        for (const Index leaf : links.triangles[triangle]) corners.push_back(cut.proxy_of_leaf(leaf));
    for (const MeshRange& range : tree.ranges()) {
        const auto place = [&](std::uint64_t source) {
            const auto found = std::partition_point(order.begin(), order.end(),
                                                    [&](const auto& entry) { return entry.first < source; });
            return static_cast<std::uint64_t>(found - order.begin());
        };
        MeshRange left = range;
        left.first_triangle = place(range.first_triangle);
        left.triangle_count = place(range.first_triangle + range.triangle_count) - left.first_triangle;
        if (left.triangle_count > 0) ranges.push_back(std::move(left));
    }
    return corners;
}

} // namespace

// The index buffer and what is known of it.
struct Cut::Indices {
    explicit Indices(const VertexTree& tree) : buffer(tree) {}
    IndexBuffer buffer;
    bool is_stale = true;
    bool is_patched = false;      // writes are the whole difference to the buffer before the last change
    unsigned quiet_frames = 0;    // in a row, of few changes

    void count_changes(std::size_t changes, Index triangles) { quiet_frames = changes < few_changes(triangles) ? quiet_frames + 1 : 0; }
    std::uint64_t version = 0, writes_from = 0; // of the buffer, and before the last writes

    void change_version() {
        static std::atomic<std::uint64_t> last{0};
        version = ++last;
    }
};

Cut::Cut(const VertexTree& tree)
    : tree_(std::make_shared<const VertexTree>(tree.share())), unfolded_((tree.interior_count() + 63) / 64), proxy_(tree.leaf_count(), VertexTree::root()),
      revision_(first_revision()) {}
Cut::Cut(Cut&&) noexcept = default;
Cut& Cut::operator=(Cut&&) noexcept = default;
Cut::~Cut() = default;

bool Cut::is_unfolded(NodeId node) const noexcept { return !tree_->is_leaf(node) && test_bit(unfolded_, node); }

bool Cut::is_active(NodeId node) const noexcept {
    // Not by its parent, which a damaged file may lie about.
    const Index leaf = tree_->is_leaf(node) ? node - tree_->interior_count() : unchecked_links(*tree_).first_leaf[node];
    return leaf < tree_->leaf_count() && proxy_[leaf] == node;
}

void Cut::set_unfolded(NodeId node) {
    set_bit(unfolded_, node);
    const auto first = unchecked_links(*tree_).first_triangle;
    triangle_count_ += first[node + 1] - first[node];
}

void Cut::set_folded(NodeId node) {
    clear_bit(unfolded_, node);
    const auto first = unchecked_links(*tree_).first_triangle;
    triangle_count_ -= first[node + 1] - first[node];
}

// Makes the leaves of a node stand for the node itself.
void Cut::assign(NodeId node) {
    if (tree_->is_leaf(node)) {
        proxy_[node - tree_->interior_count()] = node;
        return;
    }
    const auto& links = unchecked_links(*tree_);
    std::fill(proxy_.begin() + links.first_leaf[node], proxy_.begin() + links.leaf_end[node], node);
}

std::span<const NodeId> Cut::children_of(NodeId node) {
    children_.clear();
    tree_->for_each_child(node, [&](NodeId child) { children_.push_back(child); });
    return children_;
}

// Somebody else than the follower changes the cut: what it knows, and the index buffer, are out of date.
void Cut::make_stale() {
    changes_.clear();
    revision_ += 2;
    if (follower_) follower_->forget();
    if (!indices_) return;
    indices_->is_stale = true;
    indices_->is_patched = false;
    indices_->quiet_frames = 0;
    indices_->buffer.drop_lists();
}

bool Cut::unfold(NodeId node) {
    assert(!tree_->is_leaf(node) && (is_active(node) || is_unfolded(node)));
    if (test_bit(unfolded_, node) || !tree_->is_sound(node)) return false;
    make_stale();
    set_unfolded(node);
    for (const NodeId child : children_of(node)) assign(child);
    return true;
}

bool Cut::fold(NodeId node) {
    assert(!tree_->is_leaf(node));
    if (!test_bit(unfolded_, node)) return false;
    tree_->for_each_child(node, [&]([[maybe_unused]] NodeId child) { assert(!is_unfolded(child)); });
    make_stale();
    set_folded(node);
    assign(node);
    return true;
}

bool Cut::unfold_ancestors(NodeId node) {
    const Index leaf = tree_->is_leaf(node) ? node - tree_->interior_count() : unchecked_links(*tree_).first_leaf[node];
    bool changed = false;
    // What stands for the node's first leaf is an ancestor as long as its number is lower.
    while (leaf < tree_->leaf_count() && proxy_[leaf] < node && unfold(proxy_[leaf])) changed = true;
    return changed;
}

bool Cut::fold_subtree(NodeId node) {
    if (tree_->is_leaf(node) || !test_bit(unfolded_, node)) return false;
    make_stale();
    for (NodeId below = node; below < unchecked_links(*tree_).subtree_end[node]; ++below)
        if (test_bit(unfolded_, below)) set_folded(below);
    assign(node);
    return true;
}

void Cut::unfold_all() {
    make_stale();
    if (!tree_->check()) { // but for what is damaged
        for (NodeId node = 0; node < tree_->interior_count(); ++node)
            if (is_active(node)) unfold(node);
        return;
    }
    for (NodeId node = 0; node < tree_->interior_count(); ++node) set_bit(unfolded_, node);
    for (Index leaf = 0; leaf < tree_->leaf_count(); ++leaf) proxy_[leaf] = tree_->interior_count() + leaf;
    triangle_count_ = tree_->triangle_count();
}

void Cut::fold_all() { fold_subtree(VertexTree::root()); }

// ---- changes in steps

void Cut::begin_changes() {
    changes_.clear();
    ++revision_;
    if (!indices_) return;
    indices_->is_patched = !indices_->is_stale && indices_->buffer.can_patch();
    indices_->buffer.begin_patch();
    indices_->writes_from = indices_->version;
}

// Gives up patching where gathering has become the cheaper way.
bool Cut::is_patching() {
    if (!indices_ || !indices_->is_patched) return false;
    if (changes_.size() < few_changes(triangle_count_)) return true;
    indices_->is_patched = false;
    indices_->buffer.drop_lists();
    return false;
}

// Reads follow from reads: links, lists, and what is drawn. Those of many changes are made to overlap. Leaves the children in soon_, where
// those of each node end.
void Cut::prefetch_changes(std::span<const NodeId> nodes, bool folds) {
    const auto& links = unchecked_links(*tree_);
    const auto first_leaf = links.first_leaf, leaf_end = links.leaf_end, first_triangle = links.first_triangle;
    const auto subtree_end = links.subtree_end;
    const auto triangles = links.triangles;
    const auto prefetch_leaves = [&](NodeId node) {
        prefetch(&first_leaf[node]);
        prefetch(&leaf_end[node]);
    };
    for (const NodeId node : nodes) {
        prefetch_leaves(node);
        prefetch(&subtree_end[node]);
        prefetch(&first_triangle[node]);
    }
    for (const NodeId node : nodes) // the first child is the node's neighbour; the next one, which most nodes have, is anywhere
        if (const NodeId child = node + 1; child < subtree_end[node] && subtree_end[child] < subtree_end[node]) prefetch_leaves(subtree_end[child]);
    soon_.clear();
    soon_ends_.clear();
    for (const NodeId node : nodes) {
        tree_->for_each_child(node, [&](NodeId child) { soon_.push_back(child); });
        soon_ends_.push_back(soon_.size());
        prefetch(&proxy_[first_leaf[node]]);
        prefetch(&proxy_[leaf_end[node] - 1]);
    }
    if (!indices_ || !indices_->is_patched) return;
    const std::span<const NodeId> active = folds ? std::span<const NodeId>(soon_) : nodes;
    const IndexBuffer& buffer = indices_->buffer;
    buffer.prefetch_places(soon_);
    if (!folds) {
        buffer.prefetch_places(nodes);
        for (const NodeId node : nodes)
            if (first_triangle[node] < tree_->triangle_count()) prefetch(&triangles[first_triangle[node]]);
    }
    buffer.prefetch_lists(active);
    // The third corners of the triangles that come.
    const auto for_each_third = [&](auto&& f) {
        for (const NodeId node : nodes)
            for (Index t = first_triangle[node]; t < first_triangle[node + 1]; ++t)
                for (const Index leaf : triangles[t])
                    if (leaf < first_leaf[node] || leaf >= leaf_end[node]) f(leaf);
    };
    if (!folds) for_each_third([&](Index leaf) { prefetch(&proxy_[leaf]); });
    buffer.prefetch_corners(active);
    if (folds) return;
    others_.clear();
    for_each_third([&](Index leaf) { others_.push_back(proxy_[leaf]); });
    buffer.prefetch_places(others_);
    buffer.prefetch_lists(others_);
}

void Cut::apply_unfold(NodeId node, std::span<const NodeId> children) {
    set_unfolded(node);
    changes_.push_back({node, false});
    for (const NodeId child : children) assign(child);
    if (is_patching()) indices_->buffer.unfold(node, children, proxy_);
}

void Cut::apply_fold(NodeId node, std::span<const NodeId> children) {
    set_folded(node);
    changes_.push_back({node, true});
    if (is_patching()) indices_->buffer.fold(node, children);
    assign(node);
}

void Cut::fold_below(NodeId node, const FunctionRef<void(NodeId)>& on_fold) {
    const NodeId end = unchecked_links(*tree_).subtree_end[node];
    for (std::size_t word = (std::size_t{end} + 63) / 64; word-- > node / 64;) {
        std::uint64_t bits = unfolded_[word];
        if (word == node / 64) bits &= ~std::uint64_t{0} << (node & 63);
        if (word == end / 64) bits &= (std::uint64_t{1} << (end & 63)) - 1;
        while (bits) {
            const int highest = 63 - std::countl_zero(bits);
            bits &= ~(std::uint64_t{1} << highest);
            const NodeId below = static_cast<NodeId>(word * 64 + static_cast<std::size_t>(highest));
            apply_fold(below);
            on_fold(below);
        }
    }
}

void Cut::end_changes(AdjustStats& stats) {
    for (const FoldChange& change : changes_) ++(change.folded ? stats.folds : stats.unfolds);
    stats.triangles = triangle_count_;
    if (!indices_) return;
    indices_->count_changes(changes_.size(), triangle_count_);
    if (indices_->is_patched) {
        indices_->buffer.end_patch();
        if (!indices_->buffer.writes().empty()) indices_->change_version();
    } else if (!changes_.empty()) indices_->is_stale = true;
    else indices_->is_patched = !indices_->is_stale; // by no writes at all
}

// ---- other cuts as wholes

bool Cut::are_few_changes(std::span<const std::uint64_t> unfolded) const {
    std::size_t changes = 0;
    for (std::size_t word = 0; word < unfolded_.size(); ++word)
        changes += static_cast<std::size_t>(std::popcount(unfolded_[word] ^ unfolded[word]));
    return changes < few_changes(triangle_count_);
}

void Cut::change_to(std::vector<std::uint64_t> unfolded, AdjustStats& stats) {
    if (!are_few_changes(unfolded)) return become(std::move(unfolded), stats);
    begin_changes();
    replay(unfolded);
    end_changes(stats);
}

void Cut::change_further(std::vector<std::uint64_t> unfolded) {
    if (are_few_changes(unfolded)) return replay(unfolded);
    const std::vector<FoldChange> before = std::move(changes_);
    AdjustStats ignored; // all changes are counted at the end
    become(std::move(unfolded), ignored);
    --revision_; // one for all of them
    changes_.insert(changes_.begin(), before.begin(), before.end());
}

// Node numbers ascend from parents to children: unfolds run upward through them, so every node is active when its turn comes,
// and folds run downward.
void Cut::replay(std::span<const std::uint64_t> unfolded) {
    for (std::size_t word = 0; word < unfolded.size(); ++word)
        for (std::uint64_t bits = unfolded[word] & ~unfolded_[word]; bits; bits &= bits - 1)
            apply_unfold(static_cast<NodeId>(word * 64 + static_cast<std::size_t>(std::countr_zero(bits))));
    for (std::size_t word = unfolded.size(); word-- > 0;) {
        for (std::uint64_t bits = unfolded_[word] & ~unfolded[word]; bits;) {
            const int highest = 63 - std::countl_zero(bits);
            apply_fold(static_cast<NodeId>(word * 64 + static_cast<std::size_t>(highest)));
            bits &= ~(std::uint64_t{1} << highest);
        }
    }
}

// The proxies of all leaves, in order: what is folded under unfolded nodes stands for its leaves, and other leaves for themselves.
void Cut::assign_all(std::span<const std::uint64_t> unfolded) {
    const auto& links = unchecked_links(*tree_);
    const auto first_leaf = links.first_leaf, leaf_end = links.leaf_end;
    const auto subtree_end = links.subtree_end;
    const NodeId end = tree_->interior_count();
    const auto next_folded = [&](NodeId node) {
        std::size_t word = node / 64;
        std::uint64_t folded = ~unfolded[word] & (~std::uint64_t{0} << (node % 64));
        while (folded == 0 && ++word < unfolded.size()) folded = ~unfolded[word];
        return folded == 0 ? end : static_cast<NodeId>(word * 64 + static_cast<std::size_t>(std::countr_zero(folded)));
    };
    // How many leaves a node has, nobody could foretell: a few places are written at once, those too many by the next ones again.
    constexpr Index at_once = 16;
    const Index leaves = tree_->leaf_count(), last_begin = leaves - std::min(leaves, at_once);
    NodeId* const proxies = proxy_.data();
    Index leaf = 0;
    const auto write = [&](Index leaves_end, auto&& proxy_of) {
        for (; leaf < leaves_end && leaf <= last_begin; leaf += at_once)
            for (Index i = 0; i < at_once; ++i) proxies[leaf + i] = proxy_of(leaf + i);
        for (; leaf < leaves_end; ++leaf) proxies[leaf] = proxy_of(leaf);
        leaf = leaves_end;
    };
    const auto stand_for_themselves = [&](Index leaves_end) {
        write(leaves_end, [end](Index l) { return end + l; });
    };
    for (NodeId node = 0; node < end; node = subtree_end[node]) {
        node = next_folded(node);
        if (node >= end) break;
        stand_for_themselves(first_leaf[node]);
        write(leaf_end[node], [node](Index) { return node; });
    }
    stand_for_themselves(leaves);
}

// Every proxy is written at most once, however deep the new cut is.
void Cut::become(std::vector<std::uint64_t> unfolded, AdjustStats& stats) {
    changes_.clear();
    ++revision_;
    for (std::size_t word = 0; word < unfolded.size(); ++word)
        for (std::uint64_t bits = unfolded[word] & ~unfolded_[word]; bits; bits &= bits - 1)
            changes_.push_back({static_cast<NodeId>(word * 64 + static_cast<std::size_t>(std::countr_zero(bits))), false});
    for (std::size_t word = unfolded.size(); word-- > 0;) {
        for (std::uint64_t bits = unfolded_[word] & ~unfolded[word]; bits;) {
            const int highest = 63 - std::countl_zero(bits);
            bits &= ~(std::uint64_t{1} << highest);
            changes_.push_back({static_cast<NodeId>(word * 64 + static_cast<std::size_t>(highest)), true});
        }
    }
    if (tree_->leaf_count() < leaves_per_change * changes_.size()) {
        count_triangles();
        assign_all(unfolded);
    } else {
        assign_changed(unfolded);
    }
    for (const FoldChange& change : changes_) ++(change.folded ? stats.folds : stats.unfolds);
    stats.triangles = triangle_count_;
    unfolded_ = std::move(unfolded);
    if (!indices_ || changes_.empty()) return;
    indices_->is_stale = true;
    indices_->is_patched = false;
    indices_->count_changes(changes_.size(), triangle_count_);
    indices_->buffer.drop_lists();
}

// The triangles of changes_.
void Cut::count_triangles() {
    const auto first = unchecked_links(*tree_).first_triangle;
    constexpr std::size_t ahead = 32; // changes between a prefetch and its use
    for (std::size_t i = 0; i < changes_.size(); ++i) {
        if (i + ahead < changes_.size()) prefetch(&first[changes_[i + ahead].node]);
        const auto [node, folded] = changes_[i];
        const Index triangles = first[node + 1] - first[node];
        triangle_count_ = folded ? triangle_count_ - triangles : triangle_count_ + triangles;
    }
}

// The triangles of changes_, and the proxies under them.
void Cut::assign_changed(const std::vector<std::uint64_t>& unfolded) {
    const auto& links = unchecked_links(*tree_);
    const auto first = links.first_triangle, first_leaf = links.first_leaf, leaf_end = links.leaf_end;
    const auto subtree_end = links.subtree_end, parents = links.parents;
    const auto prefetch_links = [&](NodeId node) {
        prefetch(&first_leaf[node]);
        prefetch(&leaf_end[node]);
        prefetch(&subtree_end[node]);
    };
    constexpr std::size_t far = 32, near = 16; // changes between a prefetch and its use
    for (std::size_t i = 0; i < changes_.size(); ++i) {
        if (i + far < changes_.size()) {
            const FoldChange& soon = changes_[i + far];
            prefetch_links(soon.node);
            prefetch(&first[soon.node]);
            if (soon.folded) prefetch(&parents[soon.node]);
        }
        if (i + near < changes_.size() && !changes_[i + near].folded) {
            const NodeId soon = changes_[i + near].node, child = soon + 1;
            if (child < subtree_end[soon] && subtree_end[child] < subtree_end[soon]) prefetch_links(subtree_end[child]);
        }
        const auto [node, folded] = changes_[i];
        const Index triangles = first[node + 1] - first[node];
        if (folded) {
            triangle_count_ -= triangles;
            if (node == VertexTree::root() || test_bit(unfolded, parents[node])) assign(node);
        } else {
            triangle_count_ += triangles;
            tree_->for_each_child(node, [&](NodeId child) {
                if (tree_->is_leaf(child) || !test_bit(unfolded, child)) assign(child);
            });
        }
    }
}

AdjustStats Cut::adjust(const FoldCriterion& criterion, const AdjustOptions& options) {
    const CallbackCosts costs(*tree_, criterion, options.visibility);
    Decision decision = options.triangle_budget ? decide_by_budget(*tree_, costs, *options.triangle_budget)
                                                : decide_by_threshold(*tree_, costs);
    AdjustStats stats;
    stats.node_tests = costs.tests();
    stats.max_fold_cost = decision.max_fold_cost;
    if (follower_) follower_->forget();
    change_to(std::move(decision.unfolded), stats);
    return stats;
}

namespace {

// Far enough away that squares of distances still fit floats.
constexpr double farthest_eye = 1e18; // mesh units

Result<void> check(const VertexTree& tree, const Viewpoint& viewpoint, const DistanceCriterion& criterion) {
    const auto invalid = [](std::string what) { return Error{ErrorCode::invalid_argument, std::move(what)}; };
    if (criterion.interior_count() != tree.interior_count())
        return invalid("The criterion is for a tree of " + std::to_string(criterion.interior_count()) + " interior nodes, and this one has " +
                       std::to_string(tree.interior_count()) + "; make one for this tree.");
    if (!is_finite(viewpoint.eye)) return invalid("The eye's position is not finite.");
    if (!(glm::length(viewpoint.eye) <= farthest_eye)) return invalid("The eye is more than 1e18 mesh units away.");
    constexpr double unit_slack = 1e-3; // directions given with three digits
    if (viewpoint.gaze && !(std::abs(glm::length(*viewpoint.gaze) - 1) <= unit_slack))
        return invalid("The gaze must be a direction of length 1.");
    for (const Frustum& frustum : viewpoint.frusta)
        for (const Plane& plane : frustum.planes)
            if (!(std::abs(glm::length(plane.normal) - 1) <= unit_slack) || !std::isfinite(plane.offset))
                return invalid("A frustum's plane needs a normal of length 1 and a finite offset.");
    if (!viewpoint.occluders.empty() && criterion.parts().spheres != DistanceCriterion::Spheres::ring)
        return invalid("Occluders need a criterion of ring spheres.");
    for (const Sphere& occluder : viewpoint.occluders) {
        const glm::dvec3 centre(occluder.centre);
        if (!is_finite(centre) || !(occluder.radius >= 0) || !std::isfinite(occluder.radius))
            return invalid("An occluder needs a finite centre and a finite radius of 0 or more.");
        if (!(glm::length(centre - viewpoint.eye) > static_cast<double>(occluder.radius))) return invalid("The eye is inside an occluder.");
    }
    if (criterion.parts().lit) return validate(viewpoint.lighting);
    return {};
}

Result<void> check(const FollowOptions& options) {
    const auto invalid = [](const char* what) { return Error{ErrorCode::invalid_argument, what}; };
    constexpr float most_hysteresis = 2;
    if (!(options.threshold > 0) || !std::isfinite(options.threshold))
        return invalid("The threshold must be more than 0 and finite.");
    if (!(options.hysteresis >= 1 && options.hysteresis <= most_hysteresis))
        return invalid("The hysteresis must be from 1 to 2.");
    if (options.milliseconds && !(*options.milliseconds >= 0)) return invalid("The time limit must be 0 or more milliseconds.");
    return {};
}

} // namespace

Result<AdjustStats> Cut::follow(const DistanceCriterion& criterion, const Viewpoint& viewpoint, const FollowOptions& options) {
    if (const auto valid = check(*tree_, viewpoint, criterion); !valid) return valid.error();
    if (const auto valid = check(options); !valid) return valid.error();
    if (!follower_) follower_ = std::make_unique<CutFollower>(*tree_);
    return follower_->follow(*this, criterion, viewpoint, options);
}

Result<std::vector<std::uint64_t>> test_every_node(const VertexTree& tree, const DistanceCriterion& criterion, const Viewpoint& viewpoint,
                                                   const FollowOptions& options) {
    if (const auto valid = check(tree, viewpoint, criterion); !valid) return valid.error();
    if (const auto valid = check(options); !valid) return valid.error();
    FoldTester tester(tree, criterion, options.cull_back_faces, options.threshold);
    tester.look_from(viewpoint, 1);
    std::vector<std::uint64_t> unfolded((std::size_t{tree.interior_count()} + 63) / 64);
    tester.decide_range(0, tree.interior_count(), unfolded.data());
    return unfolded;
}

Result<std::vector<float>> find_every_cost(const VertexTree& tree, const DistanceCriterion& criterion, const Viewpoint& viewpoint,
                                           const FollowOptions& options) {
    if (const auto valid = check(tree, viewpoint, criterion); !valid) return valid.error();
    if (const auto valid = check(options); !valid) return valid.error();
    FoldTester tester(tree, criterion, options.cull_back_faces, options.threshold);
    tester.look_from(viewpoint, 1);
    std::vector<NodeId> nodes(tree.interior_count());
    std::iota(nodes.begin(), nodes.end(), NodeId(0));
    std::vector<float> without_least(nodes.size()), costs(nodes.size());
    std::vector<std::uint64_t> unfolded((nodes.size() + 63) / 64);
    tester.find_costs(nodes, {without_least.data(), costs.data(), unfolded.data()});
    return costs;
}

Result<std::vector<AdjustStats>> follow_scene(std::span<const SceneObject> objects, Index triangle_budget) {
    std::vector<const VertexTree*> trees;
    std::vector<std::unique_ptr<FoldTester>> testers;
    std::vector<const CostSource*> tests;
    for (std::size_t i = 0; i < objects.size(); ++i) {
        const SceneObject& object = objects[i];
        if (const auto valid = check(*object.cut.tree_, object.viewpoint, object.criterion); !valid)
            return Error{valid.error().code, "Object " + std::to_string(i) + ": " + valid.error().message};
        for (std::size_t other = 0; other < i; ++other)
            if (&objects[other].cut == &object.cut)
                return Error{ErrorCode::invalid_argument, "Objects " + std::to_string(other) + " and " + std::to_string(i) +
                                                              " share one cut; give each its own."};
        trees.push_back(object.cut.tree_.get());
        testers.push_back(std::make_unique<FoldTester>(*object.cut.tree_, object.criterion, object.cull_back_faces, 1.0f, false));
        testers.back()->look_from(object.viewpoint, 1);
        tests.push_back(testers.back().get());
    }
    BudgetDecision decision = decide_budget(trees, tests, {.triangles = triangle_budget});
    std::vector<AdjustStats> stats(objects.size());
    for (std::size_t i = 0; i < objects.size(); ++i) {
        Cut& cut = objects[i].cut;
        if (cut.follower_) cut.follower_->forget();
        stats[i].node_tests = decision.node_tests;
        stats[i].max_fold_cost = decision.max_seen_cost;
        cut.change_to(std::move(decision.unfolded[i]), stats[i]);
    }
    return stats;
}

std::span<const NodeId> Cut::indices() const {
    if (!indices_) indices_ = std::make_unique<Indices>(*tree_);
    if (indices_->is_stale) {
        indices_->buffer.gather(unfolded_, proxy_, triangle_count_);
        indices_->is_stale = false;
        indices_->change_version();
        // When little has changed twice, little will change next; a frame after a jump has enough to do.
        if (indices_->quiet_frames > 1) indices_->buffer.make_lists();
    }
    return indices_->buffer.indices();
}

std::optional<std::span<const IndexWrite>> Cut::index_writes() const noexcept {
    if (!indices_ || !indices_->is_patched) return std::nullopt;
    return indices_->buffer.writes();
}

std::uint64_t Cut::index_version() const noexcept { return indices_ ? indices_->version : 0; }
std::uint64_t Cut::index_writes_from() const noexcept { return indices_ ? indices_->writes_from : 0; }

std::uint64_t Cut::byte_size() const noexcept {
    return sizeof(std::uint64_t) * unfolded_.capacity() + sizeof(NodeId) * proxy_.capacity() +
           sizeof(FoldChange) * changes_.capacity() + (follower_ ? follower_->byte_size() : 0) +
           (indices_ ? indices_->buffer.byte_size() : 0);
}

Mesh extract_mesh(const Cut& cut) {
    const VertexTree& tree = cut.tree();
    Mesh mesh;
    std::vector<NodeId> by_range;
    if (!tree.ranges().empty()) by_range = corners_by_range(cut, mesh.ranges);
    const std::span<const NodeId> indices = tree.ranges().empty() ? cut.indices() : by_range;
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
    return mesh;
}

} // namespace unseen::vdtree
