// Settles a cut: tests the nodes that are due, and folds and unfolds what follows, until every verdict is obeyed.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <unseen/vdtree/cut.h>

#include "cut/cut_front.h"
#include "cut/cut_state.h"
#include "cut/kernel/fold_tester.h"
#include "cut/waiting.h"

namespace unseen::vdtree {

// Watched (in the front) are the folded nodes under unfolded ones (or the root), and the unfolded nodes that have no
// unfolded child: what can fold or unfold next. Settling looks at the deadlines of their blocks, tests the nodes that
// are due, and changes what they say; its cost goes with the motion and with the active triangles, not with the mesh.
// All other unfolded nodes stay so while one of their children does, for criteria are monotone: where a child's verdict
// stands by more than the rounding of tests, its ancestors' tests would say the same; where it stands by less, the
// parent is tested too. Under a criterion that is not monotone all unfolded nodes are watched. So what a cut becomes
// does not depend on the way to it.
class CutSettler {
public:
    explicit CutSettler(const VertexTree& tree) : tree_(tree), front_(tree.interior_count()) {}

    // What nodes are tested by; for one call.
    struct Rules {
        FoldTester* tester = nullptr; // looks from the viewpoint; its threshold is set here
        float threshold = 1;
        float keeping = 1; // hysteresis: what is unfolded stays so down to the threshold over this
        std::optional<Index> triangle_budget;
        bool watches_ancestors = false; // the criterion is not monotone
        std::optional<std::chrono::steady_clock::time_point> time_limit;
        // Clocks that have run so far are restarted, so that deadlines in floats stay fine enough.
        double longest_run = 1;
    };

    CutFront& front() noexcept { return front_; }
    void watch_nothing();
    // What can change next, from a cut of which nothing is watched: due now, or tested, with deadlines.
    enum class Deadlines { now, found };
    void watch_all(const CutState& cut, const Rules& rules, Deadlines deadlines);
    void watch_and_settle(CutState& cut, const Rules& rules);

    // Within the cut's changes in steps. `due`: of the front's collect_due().
    void settle(CutState& cut, const Rules& rules, std::span<const CutFront::Slot> due);
    // As far as the time goes, the worst folds first; keeps what is left to do.
    void settle_in_time(CutState& cut, const Rules& rules);
    bool is_all_tested() const noexcept { return is_all_tested_; }
    bool has_waiting() const noexcept { return !waiting_.empty(); }
    // Nodes wait with their costs as of a view: these hold on while it stands still.
    void keep_costs_if(bool is_still) noexcept {
        are_costs_of_view_ = waiting_.empty() || (are_costs_of_view_ && is_still);
    }
    // No more than this costs any node that is folded, if the view is that of the last tests: the threshold, or what
    // waits.
    float largest_cost_left(float threshold) const;

    std::uint64_t take_node_tests() noexcept { return std::exchange(node_tests_, 0); } // since this was last asked
    std::uint64_t byte_size() const noexcept { return front_.byte_size() + waiting_.byte_size(); }

private:
    using Slot = CutFront::Slot;
    static constexpr Slot no_slot = CutFront::no_slot;

    void watch_border(const CutState& cut, Deadlines deadlines);
    void find_border(const CutState& cut);
    void begin_settling();
    void finish_folding(CutState& cut);
    void end_settling(CutState& cut);
    // Tests.
    void test_due(std::span<const Slot> slots);
    void test_slots(std::span<const Slot> slots);
    void ask_parent(NodeId node);
    void test_parents(const CutState& cut);
    void use_threshold_of(bool unfolded);
    // Changes.
    void prefetch_changes(CutState& cut, std::span<const NodeId> nodes, bool folds);
    void fold_wave(CutState& cut);
    void unfold_wave(CutState& cut);
    void apply_unfold(CutState& cut, NodeId node, std::span<const NodeId> children);
    void test_next_wave();
    // In time.
    bool waits(NodeId node) const;
    void let_wave_wait();
    bool find_worst(const CutState& cut, Index more = 0);
    void unfold_worst(CutState& cut);

    bool has_unfolded_child(NodeId node, std::span<const std::uint64_t> unfolded) const;
    Slot near_children_of(NodeId node) const;

    const VertexTree& tree_;
    Rules rules_; // of this call
    CutFront front_;
    std::uint64_t node_tests_ = 0;

    // For calls with a time limit.
    WaitingNodes waiting_;           // to be unfolded
    bool are_costs_of_view_ = true;  // those of waiting_, or from a viewpoint before
    bool is_all_tested_ = true;      // that was due
    CutFront::BlockId next_due_ = 0; // where to look on

    // Scratch. A wave is what changes together: its nodes do not lie under each other.
    std::vector<NodeId> wave_, next_wave_, unfolding_, folding_, parents_;
    std::vector<Slot> kept_, wave_slots_;
    std::vector<FoldCandidate> candidates_;
    std::vector<Verdict> verdicts_;
    std::vector<float> costs_, seen_costs_;
    std::vector<std::uint64_t> unfolds_;
};

} // namespace unseen::vdtree
