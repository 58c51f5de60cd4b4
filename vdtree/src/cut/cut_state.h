// What a cut is made of, for those that change it: Cut itself, the follower and geomorphs.
#pragma once

#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/internal/node_bits.h>

#include "tree/needs.h"

namespace unseen::vdtree {

class CutFollower;

// What a criterion wants unfolded is, and besides what that needs (NeedArrays), so that no triangle is turned over.
// Public functions of Cut's names do what Cut says. Not copied and not moved: cuts hold pointers into it.
class CutState {
public:
    explicit CutState(const VertexTree& tree);
    CutState(const CutState&) = delete;
    CutState& operator=(const CutState&) = delete;
    ~CutState();

    static CutState& of(Cut& cut) noexcept { return *cut.state_; }
    static const CutState& of(const Cut& cut) noexcept { return *cut.state_; }

    const VertexTree& tree() const noexcept { return tree_; }
    std::span<const std::uint64_t> unfolded() const noexcept { return unfolded_; } // one bit an interior node
    std::span<const std::uint64_t> wanted() const noexcept { return wanted_; }     // likewise
    std::span<const NodeId> proxies() const noexcept { return proxy_; }            // by leaf; always in the same place
    Index triangle_count() const noexcept { return triangle_count_; }
    std::span<const FoldChange> changes() const noexcept { return changes_; }
    std::uint64_t revision() const noexcept { return revision_; }
    std::uint64_t changes_from() const noexcept { return changes_from_; }
    // Precondition of these two: the node is interior.
    bool is_wanted(NodeId node) const noexcept { return test_bit(wanted_, node); }
    bool is_changed_by_hand() const noexcept { return !has_all_needed_; }
    bool is_unfolded_interior(NodeId node) const noexcept { return test_bit(unfolded_, node); }
    bool is_unfolded(NodeId node) const noexcept { return !tree_.is_place(node) && is_unfolded_interior(node); }
    bool is_active(NodeId node) const noexcept {
        // Not by its parent, which a damaged file may lie about.
        const Index leaf = first_leaf_of(node);
        return leaf < tree_.leaf_count() && proxy_[leaf] == node;
    }

    // The first leaf that a node, or a place, supports.
    Index first_leaf_of(NodeId node) const noexcept {
        return tree_.is_place(node) ? tree_.first_wedge(node) - tree_.interior_wedge_count()
                                    : unchecked_links(tree_).first_leaf[node];
    }

    // By the follower, which is made when it is first asked for.
    AdjustStats follow(const DistanceCriterion& criterion, const Viewpoint& viewpoint, const FollowOptions& options);
    void forget_followed() noexcept; // the cut is changed by others than the follower

    // ---- by hand

    bool unfold(NodeId node);
    bool fold(NodeId node);
    bool unfold_ancestors(NodeId node);
    bool fold_subtree(NodeId node);
    void unfold_all();

    // ---- in steps, which are patched into the index buffer: between begin_changes() and end_changes()

    void begin_changes();
    // Brings nearer what changes of these nodes will read, some tens of them at once, and finds their children.
    void prefetch_changes(std::span<const NodeId> nodes, bool folds);
    std::span<const NodeId> fetched_children() const noexcept { return soon_; } // of all of those nodes
    std::span<const NodeId> fetched_children(std::size_t i) const {             // of the i-th one
        return std::span(soon_).first(soon_ends_[i]).subspan(i == 0 ? 0 : soon_ends_[i - 1]);
    }
    void apply_unfold(NodeId node) { apply_unfold(node, children_of(node)); }
    void apply_unfold(NodeId node, std::span<const NodeId> children);
    void apply_fold(NodeId node) { apply_fold(node, children_of(node)); }
    void apply_fold(NodeId node, std::span<const NodeId> children);
    // The criterion's changes. What its nodes need follows later: by settle_needs(), or at the end.
    void want_unfold(NodeId node, std::span<const NodeId> children);
    void want_fold(NodeId node, std::span<const NodeId> children);
    void want_fold_below(NodeId node, const FunctionRef<void(NodeId)>& on_fold); // tells each node, descendants first
    void change_further(std::vector<std::uint64_t> wanted); // to another cut as a whole, within the steps
    void settle_needs();
    void end_changes(AdjustStats& stats);

    // ---- to another cut as a whole

    void change_to(std::vector<std::uint64_t> wanted, AdjustStats& stats);
    void show(std::vector<std::uint64_t> unfolded, AdjustStats& stats); // this and nothing else

    // ---- the index buffer

    std::span<const WedgeId> indices() const;

    std::uint64_t byte_size() const noexcept;

private:
    bool is_locked(NodeId node) const noexcept { return node == VertexTree::root() && tree_.is_locked(); }
    bool is_needed(NodeId node, std::uint32_t more_than = 0) const {
        return !times_needed_.empty() && times_needed_[node] > more_than;
    }
    void count_needs();
    void ask_for_needs(NodeId node);
    void drop_needs(NodeId node);
    bool is_held(NodeId node, std::span<const NodeId> children);
    bool is_joined(NodeId parent, NodeId child) const;
    void unfold_needed(NodeId node);
    void fold_spare(NodeId node);
    bool find_spare_group(NodeId node);
    void set_unfolded(NodeId node);
    void set_folded(NodeId node);
    void assign(NodeId node);
    void make_stale();
    bool is_patching();
    std::span<const NodeId> children_of(NodeId node);
    bool are_few_changes(std::span<const std::uint64_t> from, std::span<const std::uint64_t> to) const;
    void count(AdjustStats& stats) const;
    void replay(std::span<const std::uint64_t> wanted);
    std::vector<std::uint64_t> close(std::vector<std::uint64_t> wanted);
    void become(std::vector<std::uint64_t> unfolded, AdjustStats& stats);
    void count_triangles();
    void assign_changed(const std::vector<std::uint64_t>& unfolded);
    void assign_all(std::span<const std::uint64_t> unfolded);

    const VertexTree tree_; // a handle of its own
    std::vector<std::uint64_t> unfolded_, wanted_;
    bool has_all_needed_ = true;              // unfolded_ is what wanted_ needs, and nothing else
    bool are_needs_counted_ = false;          // times_needed_ is right
    std::vector<std::uint16_t> times_needed_; // by interior node: unfolded nodes that need it; empty where none can
    std::vector<NodeId> missing_, spare_;     // nodes that may be needed, or no more
    NeedCloser closer_;
    std::vector<NodeId> proxy_; // by leaf: the active node that stands for it
    Index triangle_count_ = 0;
    std::vector<FoldChange> changes_;
    std::uint64_t revision_, changes_from_;
    std::vector<NodeId> children_, soon_, others_, group_; // scratch
    std::vector<std::size_t> soon_ends_;
    std::unique_ptr<CutFollower> follower_;
    struct Indices;
    mutable std::unique_ptr<Indices> indices_; // made when it is first asked for
};

} // namespace unseen::vdtree
