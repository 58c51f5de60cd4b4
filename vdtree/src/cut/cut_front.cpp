#include "cut/cut_front.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "cut/kernel/prefetch.h"

namespace unseen::vdtree {

template <class F>
void CutFront::for_each_used(BlockId block, F&& f) const {
    for (std::uint32_t left = used_[block]; left; left &= left - 1)
        f(static_cast<Slot>(block * block_slots + static_cast<std::size_t>(std::countr_zero(left))));
}

void CutFront::clear() {
    // Node by node where these are few, so that the cost does not go with the tree.
    if (size_ > slots_of_nodes_.size() / 32) std::ranges::fill(slots_of_nodes_, no_slot);
    else
        for (BlockId block = 0; block < blocks_.size(); ++block)
            for_each_used(block, [&](Slot slot) { slots_of_nodes_[candidates_[slot].node] = no_slot; });
    candidates_.clear();
    blocks_.clear();
    used_.clear();
    unfolded_.clear();
    spheres_.clear();
    earliest_.clear();
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

void CutFront::reserve(std::size_t nodes) {
    if (slots_of_nodes_.empty()) slots_of_nodes_.assign(interior_count_, no_slot);
    // An eighth for what comes later.
    const std::size_t blocks = nodes / appended_slots + nodes / (8 * appended_slots) + 1;
    candidates_.reserve(blocks * block_slots);
    blocks_.reserve(blocks);
    used_.reserve(blocks);
    unfolded_.reserve(blocks);
    spheres_.reserve(blocks);
    earliest_.reserve(blocks);
    for (SideDeadlines* side : {&lights_, &planes_})
        if (side->is_used()) side->reserve(blocks);
}

// ---- slots

CutFront::BlockId CutFront::new_block() {
    BlockId block;
    if (free_blocks_.empty()) {
        block = static_cast<BlockId>(blocks_.size());
        blocks_.emplace_back();
        used_.push_back(0);
        unfolded_.push_back(0);
        candidates_.resize(candidates_.size() + block_slots);
        spheres_.push_back();
        earliest_.push_back(never);
        for (SideDeadlines* side : {&lights_, &planes_})
            if (side->is_used()) side->push_back();
    } else {
        block = free_blocks_.back();
        free_blocks_.pop_back();
    }
    std::ranges::fill(blocks_[block].position, never);
    std::ranges::fill(blocks_[block].facing, never);
    return block;
}

CutFront::Slot CutFront::take(BlockId block, const FoldCandidate& candidate) {
    const auto place = static_cast<std::size_t>(std::countr_one(used_[block]));
    const Slot slot = static_cast<Slot>(block * block_slots + place);
    used_[block] = static_cast<std::uint16_t>(used_[block] | (1u << place));
    candidates_[slot] = candidate;
    slots_of_nodes_[candidate.node] = slot;
    ++size_;
    return slot;
}

CutFront::Slot CutFront::append(const FoldCandidate& candidate) {
    if (first_unplaced_ == blocks_.size() || std::popcount(used_.back()) == appended_slots) new_block();
    return take(static_cast<BlockId>(blocks_.size() - 1), candidate);
}

void CutFront::end_append() {
    for (; first_unplaced_ < blocks_.size(); ++first_unplaced_) place(first_unplaced_);
}

CutFront::Slot CutFront::insert(const FoldCandidate& candidate, Slot near) {
    if (near == no_slot) {
        const BlockId block = new_block();
        const Slot slot = take(block, candidate);
        place(block);
        first_unplaced_ = static_cast<BlockId>(blocks_.size());
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

void CutFront::remove(NodeId node) {
    const Slot slot = slots_of_nodes_[node];
    if (slot == no_slot) return;
    slots_of_nodes_[node] = no_slot;
    const BlockId block = static_cast<BlockId>(slot / block_slots);
    const std::size_t place = slot % block_slots;
    blocks_[block].position[place] = blocks_[block].facing[place] = never;
    for (SideDeadlines* side : {&lights_, &planes_})
        if (side->is_used()) side->remove(block, place);
    used_[block] = static_cast<std::uint16_t>(used_[block] & ~(1u << place));
    --size_;
    if (used_[block] != 0) return;
    reset_earliest(block);
    free_blocks_.push_back(block);
}

// ---- spheres

float CutFront::distance_to(const glm::vec3& point) const noexcept {
    float square = 0;
    for (int k = 0; k < 3; ++k) {
        const float e = (eye_high_[k] - point[k]) + eye_low_[k];
        square += e * e;
    }
    return std::sqrt(square);
}

// Around the nodes that the block has.
void CutFront::place(BlockId block) {
    glm::vec3 lowest(std::numeric_limits<float>::infinity()), highest(-lowest);
    for_each_used(block, [&](Slot slot) {
        const glm::vec3& c = candidates_[slot].sphere.centre;
        lowest = glm::min(lowest, c);
        highest = glm::max(highest, c);
    });
    const glm::vec3 centre = 0.5f * lowest + 0.5f * highest;
    spheres_.set(block, centre, 0, distance_to(centre));
    for_each_used(block, [&](Slot slot) { include(block, candidates_[slot]); });
}

void CutFront::include(BlockId block, const FoldCandidate& candidate) {
    const glm::vec3 away = candidate.sphere.centre - spheres_.centre(block);
    // Rounding of the differences in floats, of coordinates about as far from the origin as the centre and the radius
    // are.
    const float inexact = sum_rounding * (glm::length(spheres_.centre(block)) + glm::length(away));
    spheres_.radius[block] = std::max(spheres_.radius[block], glm::length(away) + inexact);
}

void CutFront::reset_earliest(BlockId block) {
    earliest_.set(block, never, never, never);
    for (SideDeadlines* side : {&lights_, &planes_})
        if (side->is_used()) side->reset_earliest(block);
}

// What is left of them now.
CutFront::Slacks CutFront::slacks_of(Slot slot) const noexcept {
    const std::size_t block = slot / block_slots, place = slot % block_slots;
    const SlotDeadlines& deadlines = blocks_[block];
    const bool unfolded = (unfolded_[block] >> place) & 1;
    const float passed = spheres_.error[block] + position_clock_float_, distance = spheres_.distance[block];
    const float position =
        (deadlines.position[place] - passed) + (unfolded ? -distance : distance) - sum_rounding * (passed + distance);
    const auto left = [&](const SideDeadlines& side) { return side.is_used() ? side.left(block, place) : 0.0f; };
    return {unfolded, std::max(position, 0.0f), std::max(deadlines.facing[place] - facing_clock_float_.early, 0.0f),
            left(planes_), left(lights_)};
}

void CutFront::split(BlockId block) {
    std::array<Slot, block_slots> slots;
    for (std::size_t i = 0; i < block_slots; ++i) slots[i] = static_cast<Slot>(block * block_slots + i);
    std::ranges::nth_element(slots, slots.begin() + block_slots / 2, {},
                             [&](Slot slot) { return candidates_[slot].node; });
    const BlockId other = new_block();
    looked_at_.push_back(other);
    std::array<Slacks, block_slots> left; // by the block as it is
    for (std::size_t i = 0; i < block_slots; ++i) left[i] = slacks_of(slots[i]);
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

// ---- deadlines

void CutFront::set_left(Slot slot, const Slacks& slacks) {
    const BlockId block = static_cast<BlockId>(slot / block_slots);
    const std::size_t place = slot % block_slots;
    const float passed = spheres_.error[block] + position_clock_float_, distance = spheres_.distance[block];
    const float slack = slacks.position - sum_rounding * (passed + distance + std::min(slacks.position, distance));
    const float position = passed + slack + (slacks.unfolded ? distance : -distance);
    const float facing = (facing_clock_float_.early + slacks.facing) * just_less;
    blocks_[block].position[place] = position;
    blocks_[block].facing[place] = facing;
    unfolded_[block] =
        static_cast<std::uint16_t>((unfolded_[block] & ~(1u << place)) | (std::uint32_t{slacks.unfolded} << place));
    float& earliest = (slacks.unfolded ? earliest_.recede : earliest_.approach)[block];
    earliest = std::min(earliest, position);
    earliest_.facing[block] = std::min(earliest_.facing[block], facing);
    if (lights_.is_used()) lights_.set(block, place, slacks.unfolded, slacks.light);
    if (planes_.is_used()) planes_.set(block, place, slacks.unfolded, slacks.planes);
}

// Unfolded nodes speak for their ancestors, too, whose tests round in their own way.
void CutFront::set_deadlines(Slot slot, const Verdict& verdict) {
    const float margin = verdict.unfolded ? rounding_margin_ : 0;
    const float position_slack = std::min(verdict.position_slack, static_cast<float>(longest_slack_));
    const auto less_margin = [&](float slack) { return std::max(slack - margin, 0.0f); };
    set_left(slot, {verdict.unfolded, less_margin(position_slack), less_margin(verdict.facing_slack),
                    less_margin(verdict.plane_slack), less_margin(verdict.light_slack)});
}

void CutFront::set_deadlines(std::span<const Slot> slots, const TestBatch& tested) {
    DeadlineBatch found;
    found.facing_clock = facing_clock_float_.early;
    found.longest = static_cast<float>(longest_slack_);
    found.margin = rounding_margin_;
    for (std::size_t i = 0; i < kernel_lanes; ++i) {
        const std::size_t block = slots[i < slots.size() ? i : 0] / block_slots;
        found.passed[i] = spheres_.error[block] + position_clock_float_;
        found.distance[i] = spheres_.distance[block];
    }
    find_deadlines(tested, found);
    for (std::size_t i = 0; i < slots.size(); ++i) {
        const std::size_t block = slots[i] / block_slots, place = slots[i] % block_slots;
        const std::uint32_t unfolded = (tested.unfolded >> i) & 1;
        blocks_[block].position[place] = found.position[i];
        blocks_[block].facing[place] = found.facing[i];
        unfolded_[block] = static_cast<std::uint16_t>((unfolded_[block] & ~(1u << place)) | (unfolded << place));
        float& earliest = (unfolded ? earliest_.recede : earliest_.approach)[block];
        earliest = std::min(earliest, found.position[i]);
        earliest_.facing[block] = std::min(earliest_.facing[block], found.facing[i]);
        const auto less_margin = [&](float slack) { return std::max(slack - (unfolded ? rounding_margin_ : 0), 0.0f); };
        if (lights_.is_used()) lights_.set(block, place, unfolded, less_margin(tested.light_slack[i]));
        if (planes_.is_used()) planes_.set(block, place, unfolded, less_margin(tested.plane_slack[i]));
    }
}

void CutFront::set_clocks(double position, double facing) {
    position_clock_ = position;
    facing_clock_ = facing;
    position_clock_float_ = static_cast<float>(position);
    facing_clock_float_ = kernel_clock(facing);
}

void CutFront::move_to(const glm::dvec3& eye, double facing) {
    const double path = glm::length(eye - eye_);
    eye_ = eye;
    for (int k = 0; k < 3; ++k) {
        eye_high_[k] = static_cast<float>(eye[k]);
        eye_low_[k] = static_cast<float>(eye[k] - static_cast<double>(eye_high_[k]));
    }
    set_clocks(position_clock_, facing_clock_ + facing);
    if (blocks_.empty() || path == 0) return;
    path_ += path;
    ++moves_;
    move_blocks(eye_high_, eye_low_, rounded_up(path), spheres_);
}

void CutFront::restart_clocks(double longest) {
    lights_.restart(longest);
    planes_.restart(longest);
    if (!(std::max({position_clock_, facing_clock_, path_}) > longest) && moves_ < most_moves) return;
    const double position = position_clock_, facing = facing_clock_;
    for (BlockId block = 0; block < blocks_.size(); ++block) {
        std::array<Slacks, block_slots> left;
        for_each_used(block, [&](Slot slot) { left[slot % block_slots] = slacks_of(slot); });
        spheres_.error[block] = 0;
        reset_earliest(block);
        set_clocks(0, 0);
        for_each_used(block, [&](Slot slot) { set_left(slot, left[slot % block_slots]); });
        set_clocks(position, facing);
    }
    set_clocks(0, 0);
    path_ = 0;
    moves_ = 0;
}

void CutFront::advance_lights(double light) {
    if (!lights_.is_used()) return;
    lights_.advance(light);
    hand_over(lights_);
}

void CutFront::advance_planes(double planes, const KernelView& view) {
    if (!planes_.is_used()) return;
    planes_.advance(planes);
    keep_inside(view, rounding_margin_, planes_.clock(), spheres_, planes_.earliest_unfolded());
    hand_over(planes_);
}

void CutFront::hand_over(SideDeadlines& side) {
    side.find_due_blocks(looked_at_);
    for (std::size_t i = 0; i < looked_at_.size(); ++i) {
        constexpr std::size_t ahead = 12; // blocks between a prefetch and its use
        if (i + ahead < looked_at_.size()) {
            side.prefetch(looked_at_[i + ahead]);
            prefetch(blocks_[looked_at_[i + ahead]].facing);
        }
        const BlockId block = looked_at_[i];
        if (side.hand_over(block, unfolded_[block], blocks_[block])) earliest_.facing[block] = -never;
    }
}

std::span<const CutFront::Slot> CutFront::collect_due() {
    find_due_blocks(0);
    return collect_due(looked_at_);
}

void CutFront::find_due_blocks(BlockId first) {
    due_blocks_.resize((blocks_.size() + 63) / 64);
    // In floats the clock may be a little late.
    vdtree::find_due_blocks(position_clock_float_, facing_clock_float_.late, spheres_, earliest_, due_blocks_.data());
    std::size_t count = 0;
    for (const std::uint64_t word : due_blocks_) count += static_cast<std::size_t>(std::popcount(word));
    looked_at_.resize(count);
    BlockId* next = looked_at_.data();
    for (std::size_t word = 0; word < due_blocks_.size(); ++word)
        for (std::uint64_t bits = due_blocks_[word]; bits; bits &= bits - 1)
            *next++ = static_cast<BlockId>(word * 64 + static_cast<std::size_t>(std::countr_zero(bits)));
    std::rotate(looked_at_.begin(), std::ranges::lower_bound(looked_at_, first), looked_at_.end());
}

std::span<const CutFront::Slot> CutFront::collect_due(std::span<const BlockId> blocks) {
    if (const std::size_t room = blocks.size() * block_slots; due_.size() < room) due_.resize(room);
    // The blocks keep the earliest deadlines of what is not due; those of the others come back when they are set.
    return std::span(due_).first(look_at_blocks(blocks, position_clock_float_, facing_clock_float_.late, blocks_.data(),
                                                unfolded_.data(), spheres_, earliest_, due_.data()));
}

std::uint64_t CutFront::byte_size() const noexcept {
    return sizeof(FoldCandidate) * candidates_.capacity() + sizeof(Slot) * slots_of_nodes_.capacity() +
           sizeof(SlotDeadlines) * blocks_.capacity() + 2 * sizeof(std::uint16_t) * used_.capacity() +
           spheres_.byte_size() + earliest_.byte_size() + lights_.byte_size() + planes_.byte_size();
}

} // namespace unseen::vdtree
