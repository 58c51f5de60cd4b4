// The front of a cut, the nodes that can change next, and when each has to be tested again.
//
// Every test says, besides its verdict, the *slack*: how far the eye may move before the test can come out otherwise. A
// clock adds up what motions use of slacks; at the node's *deadline* its slack is used up, and it is *due* to be tested
// again. There are clocks for what a motion does to distances (the position clock; by blocks, see below), to what rings
// face (the facing clock: the eye's path), and, where there are such, to eccentricities (by blocks, too), to heights over
// planes of frusta and to the light.
//
// The *rounding margin* (mesh units) is more than the rounding of any node's test. An unfolded node speaks for its
// ancestors, whose tests round in their own way: so its slacks are shortened by the margin, and where a verdict stands by
// less the parent is asked.
#pragma once

#include <algorithm>
#include <array>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/node_bits.h>

#include "cut/gaze_deadlines.h"
#include "cut/kernel/fold_tester.h"
#include "cut/side_deadlines.h"

namespace unseen::vdtree {

// Slots come in blocks of 16 neighbours, with a sphere around the centres of their nodes: as the eye moves, the nodes'
// distances change as that of the sphere's centre does, but for the radius times the angle by which the eye has moved
// around it. That tells far more than a bound on the eye's path. A full block is split in two, by node numbers.
//
// Every slot has a deadline for the distance when it grows (where the node is unfolded) or shrinks (where it is folded),
// one for the facing clock, and perhaps others for the gaze, the lights' clock and the planes'. Every block knows the
// earliest ones.
class CutFront {
public:
    using Slot = std::uint32_t;
    static constexpr Slot no_slot = 0xffffffffu;
    static constexpr std::size_t block_slots = vdtree::block_slots;

    explicit CutFront(NodeId interior_count) : interior_count_(interior_count) {}

    bool empty() const noexcept { return size_ == 0; }
    std::size_t size() const noexcept { return size_; }
    void clear() {
        // Node by node where these are few, so that the cost does not go with the tree.
        if (size_ > slots_of_nodes_.size() / 32) std::ranges::fill(slots_of_nodes_, no_slot);
        else
            for (BlockId block = 0; block < deadlines_.size(); ++block)
                for_each_used(block, [&](Slot slot) { slots_of_nodes_[candidates_[slot].node] = no_slot; });
        candidates_.clear();
        deadlines_.clear();
        used_.clear();
        unfolded_.clear();
        blocks_.for_each([](auto& values, float) { values.clear(); });
        gaze_.clear();
        lights_.clear();
        planes_.clear();
        free_blocks_.clear();
        looked_at_.clear();
        size_ = 0;
        first_unplaced_ = 0;
        path_ = 0;
        moves_ = 0;
        set_clocks(0, 0);
    }

    // Only while it is empty.
    void use(bool gaze, bool lights, bool planes) noexcept {
        gaze_.use(gaze);
        lights_.use(lights);
        planes_.use(planes);
    }
    void reserve(std::size_t nodes) {
        if (slots_of_nodes_.empty()) slots_of_nodes_.assign(interior_count_, no_slot);
        // An eighth for what comes later.
        const std::size_t blocks = nodes / appended_slots + nodes / (8 * appended_slots) + 1;
        candidates_.reserve(blocks * block_slots);
        deadlines_.reserve(blocks);
        used_.reserve(blocks);
        unfolded_.reserve(blocks);
        blocks_.for_each([&](auto& values, float) { values.reserve(whole_registers(blocks)); });
        gaze_.reserve(blocks);
        lights_.reserve(blocks);
        planes_.reserve(blocks);
    }

    // Slots hold until the next insert(). Nothing has one before the first reserve().
    Slot slot_of(NodeId node) const noexcept { return slots_of_nodes_[node]; }
    const FoldCandidate& operator[](Slot slot) const noexcept { return candidates_[slot]; }
    std::span<const FoldCandidate> candidates() const noexcept { return candidates_; }
    void set_unfolded(Slot slot, bool is_unfolded) noexcept { candidates_[slot].is_unfolded = is_unfolded; }
    void set_waiting(Slot slot, bool is_waiting) noexcept { candidates_[slot].is_waiting = is_waiting; }

    // For what happens to nodes next: first these, for some nodes at once, then those.
    void prefetch_slot(NodeId node) const noexcept { prefetch(&slots_of_nodes_[node]); }
    void prefetch_deadlines(NodeId node) const noexcept {
        const Slot slot = slots_of_nodes_[node];
        if (slot == no_slot) return;
        prefetch(deadlines_[slot / block_slots].position);
        prefetch(deadlines_[slot / block_slots].facing);
        gaze_.prefetch(slot / block_slots);
        lights_.prefetch(slot / block_slots);
        planes_.prefetch(slot / block_slots);
    }

    // A node that is not watched yet, into the block of `near` (or one of its own, where that is no_slot). Its
    // deadlines are set next.
    Slot insert(const FoldCandidate& candidate, Slot near) {
        if (near == no_slot) {
            const BlockId block = new_block();
            const Slot slot = take(block, candidate);
            place(block);
            first_unplaced_ = static_cast<BlockId>(deadlines_.size());
            return slot;
        }
        BlockId block = static_cast<BlockId>(near / block_slots);
        if (used_[block] == full) {
            const NodeId neighbour = candidates_[near].node;
            split(block);
            block = static_cast<BlockId>(slots_of_nodes_[neighbour] / block_slots);
        }
        include(block, candidate);
        return take(block, candidate);
    }

    // The same for many nodes in the order of their numbers, into blocks of their own; end_append() before deadlines
    // are set.
    Slot append(const FoldCandidate& candidate) {
        if (first_unplaced_ == deadlines_.size() || std::popcount(used_.back()) == appended_slots) new_block();
        return take(static_cast<BlockId>(deadlines_.size() - 1), candidate);
    }
    void end_append() {
        for (; first_unplaced_ < deadlines_.size(); ++first_unplaced_) place(first_unplaced_);
    }
    void remove(NodeId node) {
        const Slot slot = slots_of_nodes_[node];
        if (slot == no_slot) return;
        slots_of_nodes_[node] = no_slot;
        const BlockId block = static_cast<BlockId>(slot / block_slots);
        const std::size_t place = slot % block_slots;
        deadlines_[block].position[place] = deadlines_[block].facing[place] = never_due;
        gaze_.remove(block, place);
        lights_.remove(block, place);
        planes_.remove(block, place);
        used_[block] = static_cast<std::uint16_t>(used_[block] & ~(1u << place));
        --size_;
        if (used_[block] != 0) return;
        reset_earliest(block);
        free_blocks_.push_back(block);
    }

    // Slacks of distances longer than this (mesh units) serve nothing: the eye gets to the farthest node sooner.
    void set_longest_slack(double longest) noexcept { longest_slack_ = longest; }
    double longest_slack() const noexcept { return longest_slack_; }
    void set_rounding_margin(float margin) noexcept { rounding_margin_ = margin; }
    bool is_within_rounding(const Verdict& verdict) const noexcept {
        return !(std::min({verdict.position_slack, verdict.facing_slack, verdict.plane_slack, verdict.light_slack}) >
                     rounding_margin_ &&
                 verdict.gaze_slack > gaze_rounding);
    }

    // From verdicts just found: when the slot is due. Verdict{} makes it due now. The second for up to sixteen slots.
    // Unfolded nodes speak for their ancestors, too, whose tests round in their own way.
    void set_deadlines(Slot slot, const Verdict& verdict) {
        const float margin = verdict.unfolded ? rounding_margin_ : 0;
        const auto less_margin = [&](float slack) { return std::max(slack - margin, 0.0f); };
        set_left(slot, {less_margin(std::min(verdict.position_slack, static_cast<float>(longest_slack_))),
                        gaze_slack_of(verdict.gaze_slack, verdict.unfolded), less_margin(verdict.facing_slack),
                        less_margin(verdict.plane_slack), less_margin(verdict.light_slack), verdict.unfolded});
    }

    void set_deadlines(std::span<const Slot> slots, const TestBatch& tested) {
        DeadlineBatch found;
        found.facing_clock = facing_clock_float_.early;
        found.longest = static_cast<float>(longest_slack_);
        found.margin = rounding_margin_;
        for (std::size_t i = 0; i < kernel_lanes; ++i) {
            const std::size_t block = slots[i < slots.size() ? i : 0] / block_slots;
            found.passed[i] = blocks_.error[block] + position_clock_float_;
            found.distance[i] = blocks_.distance[block];
        }
        deadline_kernel.find_deadlines(tested, found);
        for (std::size_t i = 0; i < slots.size(); ++i) {
            const std::size_t block = slots[i] / block_slots, place = slots[i] % block_slots;
            const bool unfolded = (tested.unfolded >> i) & 1;
            set_verdict(block, place, unfolded, found.position[i], found.facing[i]);
            const auto less_margin = [&](float slack) {
                return std::max(slack - (unfolded ? rounding_margin_ : 0), 0.0f);
            };
            gaze_.set(block, place, unfolded, gaze_slack_of(tested.gaze_slack[i], unfolded));
            lights_.set(block, place, unfolded, less_margin(tested.light_slack[i]));
            planes_.set(block, place, unfolded, less_margin(tested.plane_slack[i]));
        }
    }

    // The eye goes to a place, and the facing clock on. In place of that, or besides:
    void move_to(const glm::dvec3& eye, double facing) {
        const double path = glm::length(eye - eye_);
        eye_ = eye;
        for (int k = 0; k < 3; ++k) {
            eye_high_[k] = static_cast<float>(eye[k]);
            eye_low_[k] = static_cast<float>(eye[k] - static_cast<double>(eye_high_[k]));
        }
        set_clocks(position_clock_, facing_clock_ + facing);
        if (deadlines_.empty() || path == 0) return;
        path_ += path;
        ++moves_;
        deadline_kernel.move_blocks(eye_high_, eye_low_, rounded_up(path), blocks_);
    }

    // All distances may have changed by so much, whichever way.
    void advance(double position) { set_clocks(position_clock_ + position, facing_clock_); }
    // What is due by these is due by the facing clock from then on. The gaze: moves with the eye, or alone. Planes: heights
    // over those of `view` may have changed by so much; what is unfolded in blocks wholly inside a frustum needs no test.
    void look(const glm::dvec3& gaze) { gaze_.look(gaze); } // only while it is empty
    void turn_gaze(const GazeMotion& motion) {
        gaze_.turn(motion, blocks_, looked_at_);
        hand_over(gaze_);
    }
    void advance_lights(double light) {
        if (!lights_.is_used()) return;
        lights_.advance(light);
        if (!lights_.may_be_due()) return;
        lights_.find_due_blocks(looked_at_);
        hand_over(lights_);
    }

    void advance_planes(double planes, const KernelView& view) {
        if (!planes_.is_used()) return;
        planes_.advance(planes);
        if (!planes_.may_be_due()) return;
        deadline_kernel.keep_inside(view, rounding_margin_, planes_.clock(), blocks_, planes_.earliest_unfolded());
        planes_.find_due_blocks(looked_at_);
        hand_over(planes_);
    }

    // Sets back what has grown beyond `longest`, or has been added to very often, so that deadlines in floats stay fine
    // enough.
    void restart_clocks(double longest) {
        lights_.restart(longest);
        planes_.restart(longest);
        if (!(std::max({position_clock_, facing_clock_, path_}) > longest) && moves_ < most_moves &&
            !gaze_.is_to_restart())
            return;
        const double position = position_clock_, facing = facing_clock_;
        for (BlockId block = 0; block < deadlines_.size(); ++block) {
            std::array<Verdict, block_slots> left;
            for_each_used(block, [&](Slot slot) { left[slot % block_slots] = left_of(slot); });
            blocks_.error[block] = 0;
            gaze_.restart_block(block);
            reset_earliest(block);
            set_clocks(0, 0);
            for_each_used(block, [&](Slot slot) { set_left(slot, left[slot % block_slots]); });
            set_clocks(position, facing);
        }
        set_clocks(0, 0);
        gaze_.end_restart();
        path_ = 0;
        moves_ = 0;
    }

    // The slots that are due, until the next call. These get new deadlines.
    std::span<const Slot> collect_due() {
        find_due_blocks(0);
        return collect_due(looked_at_);
    }
    // The same some blocks at a time; what lies in blocks that are not asked for stays due. Finds the blocks, from
    // number `first` on and round to it again; blocks that are split join the others at the end.
    using BlockId = std::uint32_t;
    void find_due_blocks(BlockId first) {
        due_blocks_.resize(words_for(deadlines_.size()));
        // In floats the clock may be a little late.
        deadline_kernel.find_due_blocks(position_clock_float_, facing_clock_float_.late, blocks_, due_blocks_.data());
        looked_at_.clear();
        for_each_bit(due_blocks_, [&](BlockId block) { looked_at_.push_back(block); });
        std::rotate(looked_at_.begin(), std::ranges::lower_bound(looked_at_, first), looked_at_.end());
    }

    std::span<const BlockId> due_blocks() const noexcept { return looked_at_; }
    std::span<const Slot> collect_due(std::span<const BlockId> blocks) {
        if (const std::size_t room = blocks.size() * block_slots; due_.size() < room) due_.resize(room);
        // The blocks keep the earliest deadlines of what is not due; those of the others come back when they are set.
        return std::span(due_).first(deadline_kernel.look_at_blocks(blocks, position_clock_float_,
                                                                    facing_clock_float_.late, deadlines_.data(),
                                                                    unfolded_.data(), blocks_, due_.data()));
    }

    std::uint64_t byte_size() const noexcept {
        return sizeof(FoldCandidate) * candidates_.capacity() + sizeof(Slot) * slots_of_nodes_.capacity() +
               sizeof(SlotDeadlines) * deadlines_.capacity() + 2 * sizeof(std::uint16_t) * used_.capacity() +
               blocks_.byte_size() + gaze_.byte_size() + lights_.byte_size() + planes_.byte_size();
    }

private:
    static constexpr std::size_t appended_slots = 12; // a quarter is left for what comes later
    static constexpr std::uint16_t full = 0xffff;
    // Each move rounds the blocks' errors up by a share of 5e-7: this many moves by a twentieth, but a hundred times as many
    // beyond all bounds, however small the moves are.
    static constexpr int most_moves = 100'000;

    BlockId new_block() {
        BlockId block;
        if (free_blocks_.empty()) {
            block = static_cast<BlockId>(deadlines_.size());
            deadlines_.emplace_back();
            used_.push_back(0);
            unfolded_.push_back(0);
            candidates_.resize(candidates_.size() + block_slots);
            blocks_.for_each(
                [&](auto& values, float fill) { values.resize(whole_registers(deadlines_.size()), fill); });
            gaze_.push_back();
            lights_.push_back();
            planes_.push_back();
        } else {
            block = free_blocks_.back();
            free_blocks_.pop_back();
        }
        std::ranges::fill(deadlines_[block].position, never_due);
        std::ranges::fill(deadlines_[block].facing, never_due);
        return block;
    }

    // Slacks as they are left from now on.
    void set_left(Slot slot, const Verdict& left) {
        const std::size_t block = slot / block_slots, place = slot % block_slots;
        const float passed = blocks_.error[block] + position_clock_float_, distance = blocks_.distance[block];
        const float slack =
            left.position_slack - sum_rounding * (passed + distance + std::min(left.position_slack, distance));
        set_verdict(block, place, left.unfolded, passed + slack + (left.unfolded ? distance : -distance),
                    (facing_clock_float_.early + left.facing_slack) * just_less);
        gaze_.set(block, place, left.unfolded, left.gaze_slack);
        lights_.set(block, place, left.unfolded, left.light_slack);
        planes_.set(block, place, left.unfolded, left.plane_slack);
    }

    Verdict left_of(Slot slot) const noexcept {
        const std::size_t block = slot / block_slots, place = slot % block_slots;
        const bool unfolded = (unfolded_[block] >> place) & 1;
        const float passed = blocks_.error[block] + position_clock_float_, distance = blocks_.distance[block];
        const float position = (deadlines_[block].position[place] - passed) + (unfolded ? -distance : distance) -
                               sum_rounding * (passed + distance);
        return {std::max(position, 0.0f),
                gaze_.left(block, place, unfolded),
                std::max(deadlines_[block].facing[place] - facing_clock_float_.early, 0.0f),
                planes_.left(block, place),
                lights_.left(block, place),
                unfolded};
    }

    // With the deadlines of the two clocks that always count.
    void set_verdict(std::size_t block, std::size_t place, bool is_unfolded, float position, float facing) {
        deadlines_[block].position[place] = position;
        deadlines_[block].facing[place] = facing;
        unfolded_[block] =
            static_cast<std::uint16_t>((unfolded_[block] & ~(1u << place)) | (std::uint32_t{is_unfolded} << place));
        float& earliest = (is_unfolded ? blocks_.recede : blocks_.approach)[block];
        earliest = std::min(earliest, position);
        blocks_.facing[block] = std::min(blocks_.facing[block], facing);
    }

    // Around the nodes that the block has.
    void place(BlockId block) {
        glm::vec3 lowest(std::numeric_limits<float>::infinity()), highest(-lowest);
        for_each_used(block, [&](Slot slot) {
            const glm::vec3& c = candidates_[slot].sphere.centre;
            lowest = glm::min(lowest, c);
            highest = glm::max(highest, c);
        });
        const glm::vec3 centre = 0.5f * lowest + 0.5f * highest;
        blocks_.set_sphere(block, centre, 0, distance_to(centre));
        gaze_.place(block, glm::vec3(glm::dvec3(centre) - eye_));
        for_each_used(block, [&](Slot slot) { include(block, candidates_[slot]); });
    }

    void split(BlockId block) {
        std::array<Slot, block_slots> slots;
        for (std::size_t i = 0; i < block_slots; ++i) slots[i] = static_cast<Slot>(block * block_slots + i);
        std::ranges::nth_element(slots, slots.begin() + block_slots / 2, {},
                                 [&](Slot slot) { return candidates_[slot].node; });
        const BlockId other = new_block();
        looked_at_.push_back(other);
        std::array<Verdict, block_slots> left; // by the block as it is
        for (std::size_t i = 0; i < block_slots; ++i) left[i] = left_of(slots[i]);
        for (std::size_t i = block_slots / 2; i < block_slots; ++i) {
            const FoldCandidate moved = candidates_[slots[i]];
            remove(moved.node);
            slots[i] = take(other, moved);
        }
        place(block);
        place(other);
        reset_earliest(block);
        for (std::size_t i = 0; i < block_slots; ++i) set_left(slots[i], left[i]);
    }

    void reset_earliest(BlockId block) {
        blocks_.set_earliest(block, never_due, never_due, never_due);
        gaze_.reset_earliest(block);
        lights_.reset_earliest(block);
        planes_.reset_earliest(block);
    }

    Slot take(BlockId block, const FoldCandidate& candidate) {
        const auto place = static_cast<std::size_t>(std::countr_one(used_[block]));
        const Slot slot = static_cast<Slot>(block * block_slots + place);
        used_[block] = static_cast<std::uint16_t>(used_[block] | (1u << place));
        candidates_[slot] = candidate;
        slots_of_nodes_[candidate.node] = slot;
        ++size_;
        return slot;
    }

    void include(BlockId block, const FoldCandidate& candidate) {
        const glm::vec3 centre = blocks_.centre(block), away = candidate.sphere.centre - centre;
        // Rounding of the differences in floats, of coordinates about as far from the origin as the centre and the radius
        // are.
        const float inexact = sum_rounding * (glm::length(centre) + glm::length(away));
        blocks_.radius[block] = std::max(blocks_.radius[block], glm::length(away) + inexact);
    }

    float distance_to(const glm::vec3& point) const noexcept {
        float square = 0;
        for (int k = 0; k < 3; ++k) {
            const float e = (eye_high_[k] - point[k]) + eye_low_[k];
            square += e * e;
        }
        return std::sqrt(square);
    }

    // Unfolded nodes speak for their ancestors here, too.
    static float gaze_slack_of(float slack, bool is_unfolded) { return slack - (is_unfolded ? gaze_rounding : 0); }

    void set_clocks(double position, double facing) {
        position_clock_ = position;
        facing_clock_ = facing;
        position_clock_float_ = static_cast<float>(position);
        facing_clock_float_ = kernel_clock(facing);
    }

    // What is due in the blocks that are looked at.
    template <class Side>
    void hand_over(Side& side) {
        for (std::size_t i = 0; i < looked_at_.size(); ++i) {
            constexpr std::size_t ahead = 12; // blocks between a prefetch and its use
            if (i + ahead < looked_at_.size()) {
                side.prefetch(looked_at_[i + ahead]);
                prefetch(deadlines_[looked_at_[i + ahead]].facing);
            }
            const BlockId block = looked_at_[i];
            if (side.hand_over(block, unfolded_[block], deadlines_[block])) blocks_.facing[block] = -never_due;
        }
    }

    template <class F>
    void for_each_used(BlockId block, F&& f) const {
        for_each_bit(used_[block], block * block_slots, f);
    }

    NodeId interior_count_;
    double longest_slack_ = 1;
    float rounding_margin_ = 0;
    std::vector<FoldCandidate> candidates_; // by slot
    std::vector<Slot> slots_of_nodes_;
    std::size_t size_ = 0;
    // By block.
    std::vector<SlotDeadlines> deadlines_;
    std::vector<std::uint16_t> used_;     // a bit a slot
    std::vector<std::uint16_t> unfolded_; // likewise: growing distances change the verdict, else shrinking ones
    BlockArrays blocks_;                  // deadlines: not later than any slot's
    GazeDeadlines gaze_;
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
