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

#include "fold_tester.h"

namespace unseen::vdtree {

// Watched are the folded nodes under unfolded ones (or the root), and the unfolded nodes that have no unfolded child: what can
// fold or unfold next. Each has a slot with two deadlines, one on each of the tester's clocks. Slots come in blocks of 16 with
// the earliest deadlines of all, so that a frame looks at some thousand numbers, tests the nodes that are due, and changes what they
// say; its cost goes with the motion and with the active triangles, not with the mesh.
// All other unfolded nodes stay so while one of their children does, for criteria are monotone: where a child's verdict stands by more
// than the rounding of tests, its ancestors' tests would say the same; where it stands by less, the parent is tested too. Under a
// criterion that is not monotone all unfolded nodes are watched. So what a cut becomes does not depend on the way to it.
class CutFollower {
public:
    explicit CutFollower(const VertexTree& tree) : tree_(tree) {}

    // Brings the cut to what the criterion and the options ask for.
    AdjustStats follow(Cut& cut, const DistanceCriterion& criterion, const Viewpoint& viewpoint, const FollowOptions& options);
    // The cut was changed by others.
    void forget() noexcept { is_tracking_ = false; }
    std::uint64_t byte_size() const noexcept;

private:
    using Slot = std::uint32_t;
    static constexpr Slot no_slot = 0xffffffffu;
    static constexpr std::size_t block_slots = 16;

    bool is_same_request(const DistanceCriterion& criterion, const FollowOptions& options) const;
    void prepare(const DistanceCriterion& criterion, const FollowOptions& options);
    void make_tester(const DistanceCriterion& criterion);
    Motion with_lights(Motion motion, const Viewpoint& viewpoint) const;
    void place_clocks(const Viewpoint& viewpoint);
    void look_from(const Viewpoint& viewpoint);
    void follow_threshold(Cut& cut, const Viewpoint& viewpoint, const Motion& motion);
    void follow_budget(Cut& cut, const Viewpoint& viewpoint, const Motion& motion);
    void keep_within_budget(Cut& cut);
    void change_threshold(Cut& cut, float factor);
    void start_with_budget(Cut& cut);
    void start_over(Cut& cut);
    void start_in_time(Cut& cut);
    void forget_slots();
    void watch_all_due(const Cut& cut);
    void test_down(NodeId top, std::vector<std::uint64_t>& unfolded, std::vector<NodeId>* left);
    void watch_wave();
    void step(Cut& cut);
    bool is_out_of_time() const;
    void collect_due();
    void settle_due(Cut& cut);
    void settle(Cut& cut);
    void test_due(std::span<const Slot> slots);
    void test_slots(std::span<const Slot> slots);
    void fold_wave(Cut& cut);
    void test_parents(const Cut& cut);
    void use_threshold_of(bool unfolded);
    bool stands_by_a_hair(const Verdict& verdict) const { return !(std::min(verdict.position_slack, verdict.facing_slack) > hair_); }
    void ask_parent(NodeId node);
    float keeping_factor() const;
    void unfold_wave(Cut& cut);
    bool has_unfolded_child(NodeId node, std::span<const std::uint64_t> unfolded) const;
    Slot watch(const FoldCandidate& candidate);
    void unwatch(NodeId node);
    void set_deadlines(Slot slot, const Verdict& verdict);
    void set_clocks(double position, double facing);
    void set_farthest(double distance) noexcept {
        farthest_ = distance;
        longest_slack_ = static_cast<float>(distance);
    }
    void refresh_block(std::size_t block);
    void restart_clocks();

    const VertexTree& tree_;
    bool is_tracking_ = false;
    bool was_complete_ = true;
    float max_fold_cost_ = 0;
    std::uint64_t criterion_ = 0;
    FollowOptions options_;
    std::optional<FoldTester> tester_;
    const DistanceCriterion* tested_ = nullptr; // what the tester refers to
    bool watches_ancestors_ = false; // the criterion is not monotone
    float threshold_ = 1;          // with hysteresis it follows the budget
    Viewpoint viewpoint_;
    double length_per_radian_ = 1;
    double farthest_ = 1;          // of the tree's points from the eye; no slack is longer
    float hair_ = 0;               // more than the rounding of any node's test, mesh units
    std::optional<std::chrono::steady_clock::time_point> time_limit_;
    double position_clock_ = 0, facing_clock_ = 0;
    float position_clock_down_ = 0, facing_clock_down_ = 0, longest_slack_ = 1;

    // By slot. Deadlines are the bits of non-negative floats, which compare like the floats.
    struct Block {
        std::array<std::int32_t, block_slots> position_due, facing_due;
    };
    std::vector<FoldCandidate> candidates_;
    std::vector<Block> blocks_;
    std::vector<std::int32_t> block_position_due_, block_facing_due_; // by block; not later than any of its slots'
    std::vector<Slot> free_slots_;
    std::vector<Slot> slot_of_node_; // by interior node

    // Of one frame.
    std::vector<NodeId> wave_, next_wave_, folding_, parents_;
    std::vector<Slot> due_, kept_, wave_slots_;
    std::vector<FoldCandidate> parent_candidates_;
    std::vector<Verdict> verdicts_;
    std::vector<std::uint32_t> due_blocks_;
    AdjustStats stats_;
};

} // namespace unseen::vdtree
