#include "watch_list.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "prefetch.h"

namespace unseen::vdtree {

namespace {

// Of what a deadline for distances is summed from: a dozen roundings of floats, when it is set and when it is compared.
constexpr float sum_rounding = 4e-6f;

float rounded_down(double clock) { return clock > 0 ? std::nextafter(static_cast<float>(clock), 0.0f) : 0.0f; }
float rounded_up(double clock) { return std::nextafter(static_cast<float>(clock), std::numeric_limits<float>::infinity()); }

using Four [[gnu::vector_size(16)]] = float; // in a register of any processor
using FourBits [[gnu::vector_size(16)]] = std::int32_t;

Four load(const float* from) {
    Four four;
    std::memcpy(&four, from, sizeof four);
    return four;
}

template <std::size_t count>
float least_of(const std::array<float, count>& values) {
    Four least = load(values.data());
    for (std::size_t i = 4; i < count; i += 4) {
        const Four next = load(&values[i]);
        least = next < least ? next : least;
    }
    return std::min(std::min(least[0], least[1]), std::min(least[2], least[3]));
}

} // namespace

template <class F>
void WatchList::for_each_used(BlockId block, F&& f) const {
    for (std::uint32_t left = used_[block]; left; left &= left - 1)
        f(static_cast<Slot>(block * block_slots + static_cast<std::size_t>(std::countr_zero(left))));
}

void WatchList::clear() {
    // Node by node where these are few, so that the cost does not go with the tree.
    if (size_ > slots_of_nodes_.size() / 32) std::ranges::fill(slots_of_nodes_, no_slot);
    else for (BlockId block = 0; block < blocks_.size(); ++block)
        for_each_used(block, [&](Slot slot) { slots_of_nodes_[candidates_[slot].node] = no_slot; });
    candidates_.clear();
    blocks_.clear();
    used_.clear();
    spheres_.clear();
    earliest_.clear();
    free_blocks_.clear();
    looked_at_.clear();
    size_ = 0;
    first_unplaced_ = 0;
    path_ = 0;
    set_clocks(0, 0);
}

void WatchList::reserve(std::size_t nodes) {
    const std::size_t blocks = nodes / appended_slots + nodes / (8 * appended_slots) + 1; // an eighth for what comes later
    candidates_.reserve(blocks * block_slots);
    blocks_.reserve(blocks);
    used_.reserve(blocks);
    spheres_.reserve(blocks);
    earliest_.reserve(blocks);
}

// ---- slots

WatchList::BlockId WatchList::new_block() {
    BlockId block;
    if (free_blocks_.empty()) {
        block = static_cast<BlockId>(blocks_.size());
        blocks_.emplace_back();
        used_.push_back(0);
        candidates_.resize(candidates_.size() + block_slots);
        spheres_.push_back();
        earliest_.push_back(never);
    } else {
        block = free_blocks_.back();
        free_blocks_.pop_back();
    }
    blocks_[block].recede_due.fill(never);
    blocks_[block].approach_due.fill(never);
    blocks_[block].facing_due.fill(never);
    return block;
}

WatchList::Slot WatchList::take(BlockId block, const FoldCandidate& candidate) {
    const auto place = static_cast<std::size_t>(std::countr_one(used_[block]));
    const Slot slot = static_cast<Slot>(block * block_slots + place);
    used_[block] = static_cast<std::uint16_t>(used_[block] | (1u << place));
    candidates_[slot] = candidate;
    slots_of_nodes_[candidate.node] = slot;
    ++size_;
    return slot;
}

WatchList::Slot WatchList::append(const FoldCandidate& candidate) {
    if (first_unplaced_ == blocks_.size() || std::popcount(used_.back()) == appended_slots) new_block();
    return take(static_cast<BlockId>(blocks_.size() - 1), candidate);
}

void WatchList::end_append() {
    for (; first_unplaced_ < blocks_.size(); ++first_unplaced_) place(first_unplaced_);
}

WatchList::Slot WatchList::insert(const FoldCandidate& candidate, Slot near) {
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

void WatchList::remove(NodeId node) {
    const Slot slot = slots_of_nodes_[node];
    if (slot == no_slot) return;
    slots_of_nodes_[node] = no_slot;
    const BlockId block = static_cast<BlockId>(slot / block_slots);
    const std::size_t place = slot % block_slots;
    blocks_[block].recede_due[place] = blocks_[block].approach_due[place] = blocks_[block].facing_due[place] = never;
    used_[block] = static_cast<std::uint16_t>(used_[block] & ~(1u << place));
    --size_;
    if (used_[block] != 0) return;
    earliest_.set(block, never, never, never);
    free_blocks_.push_back(block);
}

// ---- spheres

float WatchList::distance_to(const glm::vec3& point) const noexcept {
    float square = 0;
    for (int k = 0; k < 3; ++k) {
        const float e = (eye_high_[k] - point[k]) + eye_low_[k];
        square += e * e;
    }
    return std::sqrt(square);
}

// Around the nodes that the block has.
void WatchList::place(BlockId block) {
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

void WatchList::include(BlockId block, const FoldCandidate& candidate) {
    const glm::vec3 away = candidate.sphere.centre - spheres_.centre(block);
    // Rounding of the differences in floats, of coordinates about as far from the origin as the centre and the radius are.
    const float inexact = sum_rounding * (glm::length(spheres_.centre(block)) + glm::length(away));
    spheres_.radius[block] = std::max(spheres_.radius[block], glm::length(away) + inexact);
}

void WatchList::split(BlockId block) {
    std::array<Slot, block_slots> slots;
    for (std::size_t i = 0; i < block_slots; ++i) slots[i] = static_cast<Slot>(block * block_slots + i);
    std::ranges::nth_element(slots, slots.begin() + block_slots / 2, {}, [&](Slot slot) { return candidates_[slot].node; });
    const BlockId other = new_block();
    // What is left of the slacks, by the block as it is.
    struct Slacks {
        bool unfolded;
        float position, facing;
    };
    std::array<Slacks, block_slots> left;
    const float distance = spheres_.distance[block], passed = spheres_.error[block] + position_clock_float_;
    for (std::size_t i = 0; i < block_slots; ++i) {
        const std::size_t place = slots[i] % block_slots;
        const Block& dues = blocks_[block];
        const float position = std::min(dues.recede_due[place] - distance - passed, dues.approach_due[place] + distance - passed);
        left[i] = {dues.recede_due[place] < never, std::max(position, 0.0f), std::max(dues.facing_due[place] - facing_clock_down_, 0.0f)};
    }
    for (std::size_t i = block_slots / 2; i < block_slots; ++i) {
        const FoldCandidate moved = candidates_[slots[i]];
        remove(moved.node);
        slots[i] = take(other, moved);
    }
    place(block);
    place(other);
    earliest_.set(block, never, never, never);
    for (std::size_t i = 0; i < block_slots; ++i) set_deadlines(slots[i], left[i].unfolded, left[i].position, left[i].facing);
}

// ---- deadlines

void WatchList::set_deadlines(Slot slot, bool unfolded, float position_slack, float facing_slack) {
    const BlockId block = static_cast<BlockId>(slot / block_slots);
    const std::size_t place = slot % block_slots;
    const float passed = spheres_.error[block] + position_clock_float_, distance = spheres_.distance[block];
    const float slack = position_slack - sum_rounding * (passed + distance + std::min(position_slack, distance));
    const float recede = unfolded ? passed + distance + slack : never;
    const float approach = unfolded ? never : passed - distance + slack;
    const float facing = std::nextafter(facing_clock_down_ + facing_slack, 0.0f);
    blocks_[block].recede_due[place] = recede;
    blocks_[block].approach_due[place] = approach;
    blocks_[block].facing_due[place] = facing;
    earliest_.recede[block] = std::min(earliest_.recede[block], recede);
    earliest_.approach[block] = std::min(earliest_.approach[block], approach);
    earliest_.facing[block] = std::min(earliest_.facing[block], facing);
}

void WatchList::set_clocks(double position, double facing) {
    position_clock_ = position;
    facing_clock_ = facing;
    position_clock_float_ = static_cast<float>(position);
    facing_clock_down_ = rounded_down(facing);
}

void WatchList::move_to(const glm::dvec3& eye, double facing) {
    const double path = glm::length(eye - eye_);
    eye_ = eye;
    for (int k = 0; k < 3; ++k) {
        eye_high_[k] = static_cast<float>(eye[k]);
        eye_low_[k] = static_cast<float>(eye[k] - static_cast<double>(eye_high_[k]));
    }
    set_clocks(position_clock_, facing_clock_ + facing);
    if (blocks_.empty() || path == 0) return;
    path_ += path;
    move_blocks(eye_high_, eye_low_, rounded_up(path), spheres_);
}

void WatchList::restart_clocks(double longest) {
    if (!(std::max({position_clock_, facing_clock_, path_}) > longest)) return;
    const float facing = facing_clock_down_, position = position_clock_float_;
    set_clocks(0, 0);
    path_ = 0;
    for (BlockId block = 0; block < blocks_.size(); ++block) {
        if (used_[block] == 0) continue;
        const float distance = spheres_.distance[block], passed = spheres_.error[block] + position;
        spheres_.error[block] = 0;
        for_each_used(block, [&](Slot slot) {
            const Block& dues = blocks_[block];
            const std::size_t place = slot % block_slots;
            const float left = std::min(dues.recede_due[place] - distance - passed, dues.approach_due[place] + distance - passed);
            set_deadlines(slot, dues.recede_due[place] < never, std::max(left - sum_rounding * (passed + distance), 0.0f), std::max(dues.facing_due[place] - facing, 0.0f));
        });
        refresh(block);
    }
}

void WatchList::collect_due(std::vector<Slot>& due) {
    due_blocks_.resize((blocks_.size() + 63) / 64);
    // In floats the clock may be a little late.
    const float facing = rounded_up(facing_clock_), position = position_clock_float_;
    find_due(position, facing, spheres_, earliest_, due_blocks_.data());
    const std::size_t first = looked_at_.size();
    for (std::size_t word = 0; word < due_blocks_.size(); ++word) {
        for (std::uint64_t bits = due_blocks_[word]; bits; bits &= bits - 1) {
            const auto block = static_cast<BlockId>(word * 64 + static_cast<std::size_t>(std::countr_zero(bits)));
            prefetch(&blocks_[block].recede_due);
            prefetch(&blocks_[block].approach_due);
            prefetch(&blocks_[block].facing_due);
            looked_at_.push_back(block);
        }
    }
    for (std::size_t at = first; at < looked_at_.size(); ++at) {
        const BlockId block = looked_at_[at];
        const Block& dues = blocks_[block];
        const float passed = spheres_.error[block] + position;
        const float recede = passed + spheres_.distance[block], approach = passed - spheres_.distance[block];
        std::uint32_t bits = 0;
        constexpr FourBits places = {1, 2, 4, 8};
        for (std::size_t i = 0; i < block_slots; i += 4) {
            const FourBits is_due = ((load(&dues.recede_due[i]) <= recede) | (load(&dues.approach_due[i]) <= approach) |
                                     (load(&dues.facing_due[i]) <= facing)) & places;
            bits |= static_cast<std::uint32_t>(is_due[0] | is_due[1] | is_due[2] | is_due[3]) << i;
        }
        for (; bits; bits &= bits - 1) {
            const std::size_t slot = block * block_slots + static_cast<std::size_t>(std::countr_zero(bits));
            prefetch(&candidates_[slot]);
            due.push_back(static_cast<Slot>(slot));
        }
    }
}

void WatchList::refresh(BlockId block) {
    const Block& dues = blocks_[block];
    earliest_.set(block, least_of(dues.recede_due), least_of(dues.approach_due), least_of(dues.facing_due));
}

void WatchList::refresh() {
    for (const BlockId block : looked_at_) refresh(block);
    looked_at_.clear();
}

std::uint64_t WatchList::byte_size() const noexcept {
    return sizeof(FoldCandidate) * candidates_.capacity() + sizeof(Slot) * slots_of_nodes_.capacity() + sizeof(Block) * blocks_.capacity() +
           sizeof(std::uint16_t) * used_.capacity() + spheres_.byte_size() + earliest_.byte_size();
}

} // namespace unseen::vdtree
