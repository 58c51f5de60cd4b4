#include "cut/cut_state.h"

#include <atomic>

#include "cut/cut_follower.h"
#include "cut/index_buffer.h"

namespace unseen::vdtree {

namespace {

// Patching the index buffer around one change costs about as much as gathering this many triangles.
constexpr std::size_t triangles_per_patch = 60;
std::size_t few_changes(Index triangles) { return std::max<std::size_t>(triangles / triangles_per_patch, 16); }

// Walking all leaves in order takes as long as finding the leaves of this many times fewer changes.
constexpr std::size_t leaves_per_change = 16;

// Revisions of one cut never come to those of another one.
std::uint64_t first_revision() {
    static std::atomic<std::uint64_t> cuts{0};
    return ++cuts << 40;
}

} // namespace

// The index buffer and what is known of it.
struct CutState::Indices {
    explicit Indices(const VertexTree& tree) : buffer(tree) {}
    IndexBuffer buffer;
    bool is_stale = true;
    bool is_patched = false;   // during changes in steps: each is patched
    unsigned quiet_frames = 0; // in a row, of few changes

    void count_changes(std::size_t changes, Index triangles) {
        quiet_frames = changes < few_changes(triangles) ? quiet_frames + 1 : 0;
    }
    // Until the next gathering.
    void drop() {
        is_stale = true;
        is_patched = false;
        buffer.drop_lists();
    }
};

CutState::CutState(const VertexTree& tree)
    : tree_(tree.share()), unfolded_(words_for(tree.interior_count())), wanted_(unfolded_.size()), closer_(tree_),
      proxy_(tree.leaf_count(), VertexTree::root()), revision_(first_revision()), changes_from_(revision_) {
    if (!tree.is_locked()) return;
    has_all_needed_ = false; // by the root
    AdjustStats ignored;
    change_to(wanted_, ignored);
    changes_.clear();
    changes_from_ = revision_;
}
CutState::~CutState() = default;

AdjustStats CutState::follow(const DistanceCriterion& criterion, const Viewpoint& viewpoint,
                             const FollowOptions& options) {
    if (!follower_) follower_ = std::make_unique<CutFollower>(tree_);
    return follower_->follow(*this, criterion, viewpoint, options);
}

void CutState::forget_followed() noexcept {
    if (follower_) follower_->forget();
}

void CutState::set_unfolded(NodeId node) {
    set_bit(unfolded_, node);
    triangle_count_ += unchecked_links(tree_).triangles_of(node);
}

void CutState::set_folded(NodeId node) {
    clear_bit(unfolded_, node);
    triangle_count_ -= unchecked_links(tree_).triangles_of(node);
}

// Makes a node stand for its leaves.
void CutState::assign(NodeId node) {
    const Index begin = first_leaf_of(node);
    if (tree_.is_place(node)) {
        std::fill_n(proxy_.begin() + begin, tree_.wedge_end(node) - tree_.first_wedge(node), node);
        return;
    }
    std::fill(proxy_.begin() + begin, proxy_.begin() + unchecked_links(tree_).leaf_end[node], node);
}

std::span<const NodeId> CutState::children_of(NodeId node) {
    children_.clear();
    tree_.for_each_child(node, [&](NodeId child) { children_.push_back(child); });
    return children_;
}

// Somebody else than the follower changes the cut: what it knows, and the index buffer, are out of date.
void CutState::make_stale() {
    changes_.clear();
    changes_from_ = ++revision_;
    has_all_needed_ = are_needs_counted_ = false;
    forget_followed();
    if (!indices_) return;
    indices_->drop();
    indices_->quiet_frames = 0;
}

bool CutState::unfold(NodeId node) {
    assert(!tree_.is_place(node) && (is_active(node) || is_unfolded(node)));
    if (test_bit(unfolded_, node) || !tree_.is_sound(node)) return false;
    make_stale();
    set_unfolded(node);
    for (const NodeId child : children_of(node)) assign(child);
    return true;
}

bool CutState::fold(NodeId node) {
    assert(!tree_.is_place(node));
    if (!test_bit(unfolded_, node) || is_locked(node)) return false;
    tree_.for_each_child(node, [&]([[maybe_unused]] NodeId child) { assert(!is_unfolded(child)); });
    make_stale();
    set_folded(node);
    assign(node);
    return true;
}

bool CutState::unfold_ancestors(NodeId node) {
    const Index leaf = first_leaf_of(node);
    bool changed = false;
    // What stands for the node's first leaf is an ancestor as long as its number is lower.
    while (leaf < tree_.leaf_count() && proxy_[leaf] < node && unfold(proxy_[leaf])) changed = true;
    return changed;
}

bool CutState::fold_subtree(NodeId node) {
    if (tree_.is_place(node) || !test_bit(unfolded_, node)) return false;
    if (is_locked(node)) {
        bool changed = false;
        tree_.for_each_child(node, [&](NodeId child) { changed |= fold_subtree(child); });
        return changed;
    }
    make_stale();
    for (NodeId below = node; below < unchecked_links(tree_).subtree_end[node]; ++below)
        if (test_bit(unfolded_, below)) set_folded(below);
    assign(node);
    return true;
}

void CutState::unfold_all() {
    make_stale();
    if (!tree_.check()) { // but for what is damaged
        for (NodeId node = 0; node < tree_.interior_count(); ++node)
            if (is_active(node)) unfold(node);
        return;
    }
    for (NodeId node = 0; node < tree_.interior_count(); ++node) set_bit(unfolded_, node);
    for (Index leaf = 0; leaf < tree_.leaf_count(); ++leaf) proxy_[leaf] = tree_.place_of_leaf(leaf);
    triangle_count_ = tree_.triangle_count();
}

// ---- changes in steps

void CutState::begin_changes() {
    count_needs();
    changes_.clear();
    changes_from_ = revision_;
    if (!indices_) return;
    indices_->is_patched = !indices_->is_stale && indices_->buffer.can_patch();
}

// Gives up patching where gathering has become the cheaper way.
bool CutState::is_patching() {
    if (!indices_ || !indices_->is_patched) return false;
    if (changes_.size() < few_changes(triangle_count_)) return true;
    indices_->is_patched = false;
    indices_->buffer.drop_lists();
    return false;
}

// Reads follow from reads: links, lists, and what is drawn. Those of many changes are made to overlap. Leaves the
// children in soon_, where those of each node end.
void CutState::prefetch_changes(std::span<const NodeId> nodes, bool folds) {
    const auto& links = unchecked_links(tree_);
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
    // The first child is the node's neighbour; the next one, which most nodes have, is anywhere.
    for (const NodeId node : nodes)
        if (const NodeId child = node + 1; child < subtree_end[node] && subtree_end[child] < subtree_end[node])
            prefetch_leaves(subtree_end[child]);
    soon_.clear();
    soon_ends_.clear();
    for (const NodeId node : nodes) {
        tree_.for_each_child(node, [&](NodeId child) { soon_.push_back(child); });
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
            if (first_triangle[node] < tree_.triangle_count()) prefetch(&triangles[first_triangle[node]]);
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

void CutState::apply_unfold(NodeId node, std::span<const NodeId> children) {
    if (is_locked(node)) return; // it always is
    set_unfolded(node);
    changes_.push_back({node, false});
    for (const NodeId child : children) assign(child);
    if (is_patching()) indices_->buffer.unfold(node, children, proxy_);
}

void CutState::apply_fold(NodeId node, std::span<const NodeId> children) {
    if (is_locked(node)) return;
    set_folded(node);
    changes_.push_back({node, true});
    if (is_patching()) indices_->buffer.fold(node, children);
    assign(node);
}

// ---- what nodes need

void CutState::want_unfold(NodeId node, std::span<const NodeId> children) {
    set_bit(wanted_, node);
    if (is_unfolded_interior(node)) return; // for others
    apply_unfold(node, children);
    ask_for_needs(node);
}

void CutState::want_fold(NodeId node, std::span<const NodeId> children) {
    if (is_locked(node)) return;
    clear_bit(wanted_, node);
    if (is_held(node, children)) {
        spare_.push_back(node); // perhaps not for long
        return;
    }
    apply_fold(node, children);
    drop_needs(node);
}

void CutState::want_fold_below(NodeId node, const FunctionRef<void(NodeId)>& on_fold) {
    const NodeId end = unchecked_links(tree_).subtree_end[node];
    for (std::size_t word = words_for(end); word-- > node / 64;) {
        std::uint64_t bits = wanted_[word];
        if (word == node / 64) bits &= ~std::uint64_t{0} << (node & 63);
        if (word == end / 64) bits &= (std::uint64_t{1} << (end & 63)) - 1;
        for_each_bit_down(bits, 64 * word, [&](NodeId below) {
            want_fold(below, children_of(below));
            on_fold(below);
        });
    }
}

void CutState::count_needs() {
    if (are_needs_counted_) return;
    are_needs_counted_ = true;
    const auto& links = unchecked_links(tree_);
    if (links.needing.empty()) return;
    times_needed_.assign(tree_.interior_count(), 0);
    for_each_need(links, unfolded_, [&](NodeId need) { ++times_needed_[need & ~joined_need]; });
}

void CutState::ask_for_needs(NodeId node) {
    const auto& links = unchecked_links(tree_);
    if (!links.is_needing(node)) return;
    for (const NodeId need : links.needs_of(node)) {
        const NodeId needed = need & ~joined_need;
        ++times_needed_[needed];
        if (!is_unfolded_interior(needed)) missing_.push_back(needed);
    }
}

void CutState::drop_needs(NodeId node) {
    const auto& links = unchecked_links(tree_);
    if (!links.is_needing(node)) return;
    for (const NodeId need : links.needs_of(node)) {
        const NodeId needed = need & ~joined_need;
        if (--times_needed_[needed] == 0 && is_unfolded_interior(needed) && !is_wanted(needed))
            spare_.push_back(needed);
    }
}

// By others that need it, or by what is unfolded under it.
bool CutState::is_held(NodeId node, std::span<const NodeId> children) {
    if (is_needed(node)) return true;
    return std::ranges::any_of(children,
                               [&](NodeId child) { return !tree_.is_place(child) && is_unfolded_interior(child); });
}

bool CutState::is_joined(NodeId parent, NodeId child) const {
    const auto& links = unchecked_links(tree_);
    return links.is_needing(parent) &&
           std::ranges::find(links.needs_of(parent), child | joined_need) != links.needs_of(parent).end();
}

// With what is folded above it.
void CutState::unfold_needed(NodeId node) {
    const Index leaf = first_leaf_of(node);
    while (leaf < tree_.leaf_count() && proxy_[leaf] <= node && tree_.is_sound(proxy_[leaf])) {
        const NodeId above = proxy_[leaf];
        apply_unfold(above);
        ask_for_needs(above);
    }
}

// The node and what folds with it alone, parents first, in group_; false: something holds it.
bool CutState::find_spare_group(NodeId node) {
    group_.assign(1, node);
    for (std::size_t i = 0; i < group_.size(); ++i) {
        const NodeId member = group_[i];
        const std::uint32_t by_parent = i == 0 ? 0 : 1;
        if (is_needed(member, by_parent)) return false;
        for (const NodeId child : children_of(member)) {
            if (tree_.is_place(child) || !is_unfolded_interior(child)) continue;
            if (is_wanted(child) || !is_joined(member, child)) return false;
            group_.push_back(child);
        }
    }
    return true;
}

void CutState::fold_spare(NodeId node) {
    if (!is_unfolded_interior(node) || is_wanted(node)) return;
    const NodeId parent = node == VertexTree::root() ? no_node : unchecked_links(tree_).parents[node];
    const bool has_spare_parent = parent != no_node && !is_wanted(parent);
    if (find_spare_group(node)) {
        for (std::size_t i = group_.size(); i-- > 0;) {
            apply_fold(group_[i]);
            drop_needs(group_[i]);
        }
        if (has_spare_parent) spare_.push_back(parent);
    } else if (has_spare_parent && is_joined(parent, node)) {
        spare_.push_back(parent);
    }
}

void CutState::settle_needs() {
    while (!missing_.empty()) {
        const NodeId node = missing_.back();
        missing_.pop_back();
        if (!is_unfolded_interior(node) && is_needed(node)) unfold_needed(node);
    }
    while (!spare_.empty()) {
        const NodeId node = spare_.back();
        spare_.pop_back();
        fold_spare(node);
    }
}

std::vector<std::uint64_t> CutState::close(std::vector<std::uint64_t> wanted) {
    closer_.close(wanted, [](NodeId) {});
    return wanted;
}

void CutState::count(AdjustStats& stats) const {
    for (const FoldChange& change : changes_) ++(change.folded ? stats.folds : stats.unfolds);
    stats.triangles = triangle_count_;
}

void CutState::end_changes(AdjustStats& stats) {
    settle_needs();
    count(stats);
    if (!changes_.empty()) ++revision_;
    if (!indices_) return;
    indices_->count_changes(changes_.size(), triangle_count_);
    if (indices_->is_patched) indices_->buffer.end_patch();
    else if (!changes_.empty()) indices_->is_stale = true;
}

// ---- other cuts as wholes

bool CutState::are_few_changes(std::span<const std::uint64_t> from, std::span<const std::uint64_t> to) const {
    std::size_t changes = 0;
    for (std::size_t word = 0; word < from.size(); ++word)
        changes += static_cast<std::size_t>(std::popcount(from[word] ^ to[word]));
    return changes < few_changes(triangle_count_);
}

// Node numbers ascend from parents to children: unfolds run upward through them, so every node is active when its turn
// comes, and folds run downward.
template <class Unfold, class Fold>
void for_each_change(std::span<const std::uint64_t> from, std::span<const std::uint64_t> to, Unfold&& unfold,
                     Fold&& fold) {
    for (std::size_t word = 0; word < to.size(); ++word) for_each_bit(to[word] & ~from[word], 64 * word, unfold);
    for (std::size_t word = to.size(); word-- > 0;) for_each_bit_down(from[word] & ~to[word], 64 * word, fold);
}

void CutState::change_to(std::vector<std::uint64_t> wanted, AdjustStats& stats) {
    if (tree_.is_locked()) set_bit(wanted, VertexTree::root());
    if (has_all_needed_ && are_few_changes(wanted_, wanted)) {
        begin_changes();
        replay(wanted);
        return end_changes(stats);
    }
    wanted_ = wanted;
    become(close(std::move(wanted)), stats);
    has_all_needed_ = true;
}

void CutState::change_further(std::vector<std::uint64_t> wanted) {
    if (tree_.is_locked()) set_bit(wanted, VertexTree::root());
    if (are_few_changes(wanted_, wanted)) return replay(wanted);
    const std::vector<FoldChange> before = std::move(changes_);
    const std::uint64_t from = changes_from_;
    AdjustStats ignored; // all changes are counted at the end
    missing_.clear();
    spare_.clear();
    change_to(std::move(wanted), ignored);
    revision_ = changes_from_ = from; // one for all of them, at the end
    changes_.insert(changes_.begin(), before.begin(), before.end());
}

void CutState::replay(std::span<const std::uint64_t> wanted) {
    for_each_change(
        wanted_, wanted, [&](NodeId node) { want_unfold(node, children_of(node)); },
        [&](NodeId node) { want_fold(node, children_of(node)); });
}

void CutState::show(std::vector<std::uint64_t> unfolded, AdjustStats& stats) {
    if (!are_few_changes(unfolded_, unfolded)) return become(std::move(unfolded), stats);
    begin_changes();
    for_each_change(
        unfolded_, unfolded, [&](NodeId node) { apply_unfold(node); }, [&](NodeId node) { apply_fold(node); });
    end_changes(stats);
}

// The proxies of all leaves, in order: what is folded under unfolded nodes stands for its leaves, and places for those of
// other leaves.
void CutState::assign_all(std::span<const std::uint64_t> unfolded) {
    const auto& links = unchecked_links(tree_);
    const auto first_leaf = links.first_leaf, leaf_end = links.leaf_end, subtree_end = links.subtree_end;
    const NodeId end = tree_.interior_count();
    const auto next_folded = [&](NodeId node) {
        std::size_t word = node / 64;
        std::uint64_t folded = ~unfolded[word] & (~std::uint64_t{0} << (node % 64));
        while (folded == 0 && ++word < unfolded.size()) folded = ~unfolded[word];
        return folded == 0 ? end : static_cast<NodeId>(word * 64 + static_cast<std::size_t>(std::countr_zero(folded)));
    };
    // The number of leaves is unpredictable, so branch-free: a few places are written at once, and the next node overwrites
    // the surplus.
    constexpr Index at_once = 16;
    const Index leaves = tree_.leaf_count();
    NodeId* const proxies = proxy_.data();
    Index leaf = 0;
    const auto write = [&](Index leaves_end, auto&& proxy_of) {
        for (; leaf < leaves_end && leaves - leaf >= at_once; leaf += at_once)
            for (Index i = 0; i < at_once; ++i) proxies[leaf + i] = proxy_of(leaf + i);
        for (; leaf < leaves_end; ++leaf) proxies[leaf] = proxy_of(leaf);
        leaf = leaves_end;
    };
    const bool has_seams = tree_.has_seams();
    const auto stand_for_themselves = [&](Index leaves_end) {
        if (has_seams) write(leaves_end, [&](Index l) { return tree_.place_of_leaf(l); });
        else write(leaves_end, [end](Index l) { return end + l; });
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
void CutState::become(std::vector<std::uint64_t> unfolded, AdjustStats& stats) {
    changes_.clear();
    changes_from_ = revision_;
    are_needs_counted_ = false;
    for_each_change(
        unfolded_, unfolded,
        [&](NodeId node) {
            changes_.push_back({node, false});
        },
        [&](NodeId node) {
            changes_.push_back({node, true});
        });
    if (!changes_.empty()) ++revision_;
    if (tree_.leaf_count() < leaves_per_change * changes_.size()) {
        count_triangles();
        assign_all(unfolded);
    } else {
        assign_changed(unfolded);
    }
    unfolded_ = std::move(unfolded);
    count(stats);
    if (!indices_ || changes_.empty()) return;
    indices_->drop();
    indices_->count_changes(changes_.size(), triangle_count_);
}

// The triangles of changes_.
void CutState::count_triangles() {
    const auto first = unchecked_links(tree_).first_triangle;
    constexpr std::size_t ahead = 32; // changes between a prefetch and its use
    for (std::size_t i = 0; i < changes_.size(); ++i) {
        if (i + ahead < changes_.size()) prefetch(&first[changes_[i + ahead].node]);
        const Index triangles = unchecked_links(tree_).triangles_of(changes_[i].node);
        triangle_count_ = changes_[i].folded ? triangle_count_ - triangles : triangle_count_ + triangles;
    }
}

// The triangles of changes_, and the proxies under them.
void CutState::assign_changed(const std::vector<std::uint64_t>& unfolded) {
    const auto& links = unchecked_links(tree_);
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
        if (folded) {
            triangle_count_ -= links.triangles_of(node);
            if (node == VertexTree::root() || test_bit(unfolded, parents[node])) assign(node);
        } else {
            triangle_count_ += links.triangles_of(node);
            tree_.for_each_child(node, [&](NodeId child) {
                if (tree_.is_place(child) || !test_bit(unfolded, child)) assign(child);
            });
        }
    }
}

std::span<const WedgeId> CutState::indices() const {
    if (!indices_) indices_ = std::make_unique<Indices>(tree_);
    if (indices_->is_stale) {
        indices_->buffer.gather(unfolded_, proxy_, triangle_count_);
        indices_->is_stale = false;
        // When little has changed twice, little will change next; a frame after a jump has enough to do.
        if (indices_->quiet_frames > 1) indices_->buffer.make_lists();
    }
    return indices_->buffer.indices();
}

std::uint64_t CutState::byte_size() const noexcept {
    return sizeof(std::uint64_t) * unfolded_.capacity() + sizeof(NodeId) * proxy_.capacity() +
           sizeof(FoldChange) * changes_.capacity() + (follower_ ? follower_->byte_size() : 0) +
           (indices_ ? indices_->buffer.byte_size() : 0);
}

} // namespace unseen::vdtree
