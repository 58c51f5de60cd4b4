// The front of a cut, the nodes that can change next, and when each has to be tested again.
//
// Every test says, besides its verdict, the *slack*: how far the eye may move before the test can come out otherwise
// (Verdict). A clock adds up what the eye's motion uses of slacks, and the node's *deadline* is the clock's reading at
// which its slack is used up. Then the node is *due*: it is tested again, and gets a new deadline. There are several
// clocks, for what a motion does to
//   distances (the position clock; it goes by blocks, see below), what rings face (the facing clock: the eye's path),
//   heights over the planes of frusta, and the light (SideDeadlines: only where there are such).
//
// The *rounding margin* is more than the rounding of any node's test, in mesh units. An unfolded node speaks for its
// ancestors, whose tests round in their own way: so its slacks are shortened by the margin, and a verdict that stands
// by less is one about which the parent is asked.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "cut/kernel/deadline_kernel.h"
#include "cut/kernel/fold_tester.h"
#include "cut/side_deadlines.h"

namespace unseen::vdtree {

// Slots come in blocks of 16 neighbours. A block has a sphere around the centres of its nodes: as the eye moves, their
// distances change as that of the sphere's centre does, but for the radius times the angle by which the eye has moved
// around it. So blocks know on which side of them the eye comes nearer, and by how much, far better than a bound on the
// eye's path would tell.
//
// Every slot has two deadlines: for the distance when it grows (where the node is unfolded) or shrinks (where it is
// folded), and for the facing clock; every block knows the earliest ones. Where there are lights, or planes of frusta,
// it has another one for their own clock. A full block is split in two, by node numbers, which keeps neighbours
// together.
class CutFront {
public:
    using Slot = std::uint32_t;
    static constexpr Slot no_slot = 0xffffffffu;
    static constexpr std::size_t block_slots = vdtree::block_slots;

    explicit CutFront(NodeId interior_count) : interior_count_(interior_count) {}

    bool empty() const noexcept { return size_ == 0; }
    std::size_t size() const noexcept { return size_; }
    void clear();
    // Only while it is empty.
    void use(bool lights, bool planes) noexcept {
        lights_.use(lights);
        planes_.use(planes);
    }
    void reserve(std::size_t nodes);

    // Slots hold until the next insert(). Nothing has one before the first reserve().
    Slot slot_of(NodeId node) const noexcept { return slots_of_nodes_[node]; }
    template <class F> // f(slot)
    void for_each_slot(F&& f) const {
        for (Slot slot = 0; slot < candidates_.size(); ++slot)
            if (used_[slot / block_slots] >> (slot % block_slots) & 1) f(slot);
    }
    const FoldCandidate& operator[](Slot slot) const noexcept { return candidates_[slot]; }
    std::span<const FoldCandidate> candidates() const noexcept { return candidates_; }
    void set_rows(Slot slot, FoldClass rows) noexcept { candidates_[slot].rows = rows; }
    void set_unfolded(Slot slot, bool is_unfolded) noexcept { candidates_[slot].is_unfolded = is_unfolded; }
    void set_waiting(Slot slot, bool is_waiting) noexcept { candidates_[slot].is_waiting = is_waiting; }

    // For what happens to nodes next: first these, for some nodes at once, then those.
    void prefetch_slot(NodeId node) const noexcept { prefetch(&slots_of_nodes_[node]); }
    void prefetch_deadlines(NodeId node) const noexcept {
        const Slot slot = slots_of_nodes_[node];
        if (slot == no_slot) return;
        prefetch(blocks_[slot / block_slots].position);
        prefetch(blocks_[slot / block_slots].facing);
        for (const SideDeadlines* side : {&lights_, &planes_})
            if (side->is_used()) side->prefetch(slot / block_slots);
    }

    // A node that is not watched yet, into the block of `near` (or one of its own, where that is no_slot). Its
    // deadlines are set next.
    Slot insert(const FoldCandidate& candidate, Slot near);
    // The same for many nodes in the order of their numbers, into blocks of their own; end_append() before deadlines
    // are set.
    Slot append(const FoldCandidate& candidate);
    void end_append();
    void remove(NodeId node); // also where it is not watched

    // Slacks of distances longer than this (mesh units) serve nothing: the eye gets to the farthest node sooner.
    void set_longest_slack(double longest) noexcept { longest_slack_ = longest; }
    double longest_slack() const noexcept { return longest_slack_; }
    void set_rounding_margin(float margin) noexcept { rounding_margin_ = margin; }
    bool is_within_rounding(const Verdict& verdict) const noexcept {
        return !(std::min({verdict.position_slack, verdict.facing_slack, verdict.plane_slack, verdict.light_slack}) >
                 rounding_margin_);
    }
    bool is_within_rounding(const TestBatch& tested, std::size_t lane) const noexcept {
        return !(std::min({tested.position_slack[lane], tested.facing_slack[lane], tested.plane_slack[lane]}) >
                 rounding_margin_) ||
               (lights_.is_used() && !(tested.light_slack[lane] > rounding_margin_));
    }

    // From verdicts just found: when the slot is due. Verdict{} makes it due now. The second for up to sixteen slots.
    void set_deadlines(Slot slot, const Verdict& verdict);
    void set_deadlines(std::span<const Slot> slots, const TestBatch& tested);

    // The eye goes to a place, and the facing clock on. In place of that, or besides:
    void move_to(const glm::dvec3& eye, double facing);
    // All distances, and what else slacks for them cover, may have changed by so much, whichever way; the facing clock
    // goes on.
    void advance(double position, double facing) { set_clocks(position_clock_ + position, facing_clock_ + facing); }
    // Where these are used; what is due by them is due by the facing clock from then on. Planes: heights over those of
    // `view` may have changed by so much; what is unfolded in blocks wholly inside a frustum needs no test.
    void advance_lights(double light);
    void advance_planes(double planes, const KernelView& view);
    // Sets back what has grown beyond `longest`, or has been added to very often, so that deadlines in floats stay fine
    // enough.
    void restart_clocks(double longest);

    // The slots that are due, until the next call. These get new deadlines.
    std::span<const Slot> collect_due();
    // The same some blocks at a time; what lies in blocks that are not asked for stays due. Finds the blocks, from
    // number `first` on and round to it again; blocks that are split join the others at the end.
    using BlockId = std::uint32_t;
    void find_due_blocks(BlockId first);
    std::span<const BlockId> due_blocks() const noexcept { return looked_at_; }
    std::span<const Slot> collect_due(std::span<const BlockId> blocks);

    std::uint64_t byte_size() const noexcept;

private:
    static constexpr std::size_t appended_slots = 12; // a quarter is left for what comes later
    static constexpr std::uint16_t full = 0xffff;
    static constexpr float never = std::numeric_limits<float>::infinity();
    // Each move rounds the blocks' errors up by a share of 5e-7: this many moves by a twentieth, but a hundred times as many
    // beyond all bounds, however small the moves are.
    static constexpr int most_moves = 100'000;

    // What there is left until a slot is due, from now; 0 or more. `unfolded`: what the verdict is, which only growing
    // distances change; else only shrinking ones.
    struct Slacks {
        bool unfolded = false;
        float position = 0, facing = 0, planes = 0, light = 0;
    };

    BlockId new_block();
    void set_left(Slot slot, const Slacks& slacks);
    void place(BlockId block);
    void split(BlockId block);
    void reset_earliest(BlockId block);
    Slacks slacks_of(Slot slot) const noexcept;
    Slot take(BlockId block, const FoldCandidate& candidate);
    void include(BlockId block, const FoldCandidate& candidate);
    float distance_to(const glm::vec3& point) const noexcept;
    void set_clocks(double position, double facing);
    void hand_over(SideDeadlines& side);
    template <class F>
    void for_each_used(BlockId block, F&& f) const;

    NodeId interior_count_;
    double longest_slack_ = 1;
    float rounding_margin_ = 0;
    std::vector<FoldCandidate> candidates_; // by slot
    std::vector<Slot> slots_of_nodes_;
    std::size_t size_ = 0;
    // By block.
    std::vector<SlotDeadlines> blocks_;
    std::vector<std::uint16_t> used_;     // a bit a slot
    std::vector<std::uint16_t> unfolded_; // likewise: growing distances change the verdict
    BlockSpheres spheres_;
    EarliestDeadlines earliest_; // not later than any slot's
    SideDeadlines lights_, planes_;
    std::vector<BlockId> free_blocks_, looked_at_;
    std::vector<std::uint64_t> due_blocks_;
    std::vector<Slot> due_;
    BlockId first_unplaced_ = 0; // while nodes are appended

    glm::dvec3 eye_{0};
    float eye_high_[3] = {}, eye_low_[3] = {};
    double path_ = 0; // since the clocks were restarted
    int moves_ = 0;   // likewise
    double position_clock_ = 0, facing_clock_ = 0;
    float position_clock_float_ = 0;
    KernelClock facing_clock_float_;
};

} // namespace unseen::vdtree
