// Keeps a cut at what a distance criterion asks for while the viewpoint moves, testing nodes only when their time has come.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <vdtree/cut.h>

#include "cut_state.h"
#include "decide_tree.h"
#include "fold_tester.h"
#include "watch_list.h"

namespace unseen::vdtree {

// Watched are the folded nodes under unfolded ones (or the root), and the unfolded nodes that have no unfolded child: what can
// fold or unfold next. A frame looks at the deadlines of their blocks, tests the nodes that are due, and changes what they
// say; its cost goes with the motion and with the active triangles, not with the mesh.
// All other unfolded nodes stay so while one of their children does, for criteria are monotone: where a child's verdict stands by more
// than the rounding of tests, its ancestors' tests would say the same; where it stands by less, the parent is tested too. Under a
// criterion that is not monotone all unfolded nodes are watched. So what a cut becomes does not depend on the way to it.
class CutFollower {
public:
    explicit CutFollower(const VertexTree& tree) : tree_(tree), watched_(tree.interior_count()) {}

    // Brings the cut to what the criterion and the options ask for.
    AdjustStats follow(CutState& cut, const DistanceCriterion& criterion, const Viewpoint& viewpoint, const FollowOptions& options);
    // The cut was changed by others.
    void forget() noexcept { is_tracking_ = false; }
    std::uint64_t byte_size() const noexcept;

private:
    using Slot = WatchList::Slot;
    static constexpr Slot no_slot = WatchList::no_slot;

    bool is_same_request(const DistanceCriterion& criterion, const FollowOptions& options) const;
    void prepare(const DistanceCriterion& criterion, const FollowOptions& options);
    void make_tester(const DistanceCriterion& criterion);
    Motion with_lights(Motion motion, const Viewpoint& viewpoint) const;
    void start_at(const Viewpoint& viewpoint);
    void move_to(const Viewpoint& viewpoint, const Motion& motion);
    void look_from(const Viewpoint& viewpoint);
    void follow_threshold(CutState& cut, const Viewpoint& viewpoint, const Motion& motion);
    void follow_budget(CutState& cut, const Viewpoint& viewpoint, const Motion& motion);
    void keep_within_budget(CutState& cut);
    void change_threshold(CutState& cut, float factor);
    void start_with_budget(CutState& cut);
    std::vector<std::uint64_t> decide_with_budget();
    void start_over(CutState& cut);
    bool is_out_of_deciding_time() const;
    void start_in_time(CutState& cut);
    enum class Deadlines { now, found };
    void watch_all(const CutState& cut, Deadlines deadlines);
    void find_border(const CutState& cut);
    std::vector<std::uint64_t> decide_all();
    void step(CutState& cut, const Motion& motion);
    bool is_out_of_time() const;
    void settle_due(CutState& cut);
    void settle(CutState& cut, std::span<const Slot> due);
    void settle_in_time(CutState& cut);
    void begin_settling();
    void finish_folding(CutState& cut);
    void end_settling(CutState& cut);
    void test_due(std::span<const Slot> slots);
    void test_slots(std::span<const Slot> slots);
    void prefetch_changes(CutState& cut, std::span<const NodeId> nodes, bool folds);
    void fold_wave(CutState& cut);
    void test_parents(const CutState& cut);
    void use_threshold_of(bool unfolded);
    bool stands_by_a_hair(const Verdict& verdict) const {
        return !(std::min({verdict.position_slack, verdict.facing_slack, verdict.plane_slack, verdict.light_slack}) >
                 hair_);
    }
    bool stands_by_a_hair(const TestBatch& tested, std::size_t lane) const {
        return !(std::min({tested.position_slack[lane], tested.facing_slack[lane], tested.plane_slack[lane]}) >
                 hair_) ||
               (tester_->has_lights() && !(tested.light_slack[lane] > hair_));
    }
    void ask_parent(NodeId node);
    float keeping_factor() const;
    void unfold_wave(CutState& cut);
    void test_next_wave();
    void unfold_worst(CutState& cut);
    void let_wave_wait();
    bool waits(NodeId node) const;
    NodeId pop_waiting();
    bool find_worst(const CutState& cut, Index more = 0);
    void drop_idle();
    float largest_cost_left() const;
    void watch_nothing();
    void apply_unfold(CutState& cut, NodeId node, std::span<const NodeId> children);
    bool has_unfolded_child(NodeId node, std::span<const std::uint64_t> unfolded) const;
    Slot near_children_of(NodeId node) const;
    void set_deadlines(Slot slot, const Verdict& verdict);
    void set_farthest(double distance) noexcept {
        farthest_ = distance;
        longest_slack_ = static_cast<float>(distance);
    }

    const VertexTree& tree_;
    bool is_tracking_ = false;
    bool was_complete_ = true;
    float max_fold_cost_ = 0;
    std::uint64_t criterion_ = 0;
    FollowOptions options_;
    std::optional<FoldTester> tester_;
    std::uint64_t tested_ = 0; // the criterion object that the tester refers to
    bool watches_ancestors_ = false; // the criterion is not monotone
    float threshold_ = 1;          // with hysteresis it follows the budget
    Viewpoint viewpoint_;
    double length_per_radian_ = 1;
    double farthest_ = 1;          // of the tree's points from the eye; no slack is longer
    float hair_ = 0;               // more than the rounding of any node's test, mesh units
    std::chrono::steady_clock::time_point begin_; // of the call
    std::optional<std::chrono::steady_clock::time_point> time_limit_;
    float longest_slack_ = 1;
    WatchList watched_;

    // What the time did not reach: watched nodes that are to unfold, the worst first, with some that are not so any more (see waits()).
    struct Waiting {
        float cost;
        NodeId node;
        bool operator<(const Waiting& other) const { return cost != other.cost ? cost < other.cost : node > other.node; }
    };
    std::vector<Waiting> waiting_;     // a heap
    bool are_costs_of_view_ = true;    // those of waiting_, or from a viewpoint before
    bool is_all_tested_ = true;        // that was due
    WatchList::BlockId next_due_ = 0;  // where to look on

    // Of one frame.
    std::vector<NodeId> wave_, next_wave_, unfolding_, folding_, parents_;
    std::vector<Slot> kept_, wave_slots_;
    std::vector<FoldCandidate> parent_candidates_;
    std::vector<Verdict> verdicts_;
    std::vector<float> costs_, seen_costs_;
    std::vector<std::uint64_t> unfolds_;
    TreeDecider decider_;
    AdjustStats stats_;
};

} // namespace unseen::vdtree
