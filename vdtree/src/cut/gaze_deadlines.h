// Deadlines of watched slots by the gaze: when a node's eccentricity leaves the bins that its verdict holds for.
#pragma once

#include "cut/kernel/deadline_kernel.h"
#include <unseen/vdtree/internal/simd.h>

namespace unseen::vdtree {

// As for distances, the angle between the gaze and the centre of a block's sphere is measured anew in every frame, and the
// angles of its nodes have changed by the same, up to an error that goes with the sphere's size. What turns with the view
// changes no angle, so a gaze that is fixed to a moving camera makes little due.
//
// Without a gaze it has no blocks, and nothing happens to it.
class GazeDeadlines {
public:
    void use(bool is_used) noexcept { is_used_ = is_used; } // only while there are no blocks

    void clear() {
        slots_.clear();
        blocks_.for_each([](auto& values, float) { values.clear(); });
        largest_error_ = 0;
        turns_ = 0;
    }
    void reserve(std::size_t blocks) {
        if (!is_used_) return;
        slots_.reserve(blocks);
        blocks_.for_each([&](auto& values, float) { values.reserve(whole_registers(blocks)); });
    }
    // A block without deadlines.
    void push_back() {
        if (!is_used_) return;
        slots_.emplace_back();
        std::ranges::fill(slots_.back().slots, never_due);
        blocks_.for_each([&](auto& values, float fill) { values.resize(whole_registers(slots_.size()), fill); });
    }
    void reset_earliest(std::size_t block) {
        if (is_used_) blocks_.outward[block] = blocks_.inward[block] = never_due;
    }
    // The block's sphere has a new centre: `from_eye`.
    void place(std::size_t block, const glm::vec3& from_eye) {
        if (!is_used_) return;
        blocks_.angle[block] = angle_between(from_eye, gaze_);
        blocks_.error[block] = 0;
    }

    // `slack`: the change of eccentricity that is left from now on; negative: due with any motion.
    void set(std::size_t block, std::size_t place, bool is_unfolded, float slack) {
        if (!is_used_) return;
        const float error = blocks_.error[block], angle = blocks_.angle[block];
        const float left = slack < 0 ? -never_due : slack - sum_rounding * (error + angle + slack);
        const float due = error + left + (is_unfolded ? angle : -angle);
        slots_[block].slots[place] = due;
        float& earliest = (is_unfolded ? blocks_.outward : blocks_.inward)[block];
        earliest = std::min(earliest, due);
    }
    float left(std::size_t block, std::size_t place, bool is_unfolded) const {
        if (!is_used_) return 0;
        const float error = blocks_.error[block], angle = blocks_.angle[block];
        return (slots_[block].slots[place] - error) + (is_unfolded ? -angle : angle) - sum_rounding * (error + angle);
    }
    void remove(std::size_t block, std::size_t place) {
        if (is_used_) slots_[block].slots[place] = never_due;
    }
    void prefetch(std::size_t block) const {
        if (is_used_) vdtree::prefetch(&slots_[block]);
    }

    // A gaze from which blocks are placed first.
    void look(const glm::dvec3& gaze) { gaze_ = glm::vec3(glm::normalize(gaze)); }
    // The blocks that are due after a motion, in order, in place of what was there.
    void turn(const GazeMotion& motion, const BlockArrays& spheres, std::vector<std::uint32_t>& due) {
        due.clear();
        for (int k = 0; k < 3; ++k) gaze_[k] = motion.gaze[k];
        if (slots_.empty()) return;
        due_bits_.resize(words_for(slots_.size()));
        largest_error_ = deadline_kernel.turn_blocks(motion, spheres, blocks_, due_bits_.data());
        ++turns_;
        for_each_bit(due_bits_, [&](std::uint32_t block) {
            if (block < slots_.size()) due.push_back(block);
        });
    }
    // See SideDeadlines.
    bool hand_over(std::size_t block, std::uint32_t unfolded, SlotDeadlines& dues) {
        const float error = blocks_.error[block], angle = blocks_.angle[block];
        return deadline_kernel.hand_over(error + angle, error - angle, unfolded, slots_[block].slots, dues.facing,
                                         blocks_.outward[block], blocks_.inward[block]);
    }

    // Whether errors have grown so that deadlines in floats are not fine enough any more; a block's is set back with its
    // deadlines.
    bool is_to_restart() const noexcept { return largest_error_ > longest_run || turns_ > most_turns; }
    void restart_block(std::size_t block) {
        if (is_used_) blocks_.error[block] = 0;
    }
    void end_restart() {
        largest_error_ = 0;
        turns_ = 0;
    }

    std::uint64_t byte_size() const noexcept {
        return sizeof(BlockSlots) * slots_.capacity() + 4 * sizeof(float) * blocks_.angle.capacity();
    }

private:
    static constexpr float longest_run = 512;  // radians; each block's deadlines are as fine as its own error is small
    static constexpr int most_turns = 100'000; // see CutFront::most_moves

    static float angle_between(const glm::vec3& a, const glm::vec3& b) {
        return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
    }

    struct alignas(64) BlockSlots {
        float slots[block_slots];
    };
    bool is_used_ = false;
    glm::vec3 gaze_{0};
    float largest_error_ = 0;
    int turns_ = 0;
    std::vector<BlockSlots> slots_; // by block, like the others
    GazeArrays blocks_;
    std::vector<std::uint64_t> due_bits_;
};

} // namespace unseen::vdtree
