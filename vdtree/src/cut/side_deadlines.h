// Deadlines of watched slots by a clock that only some views need: that of lights, or that of frusta.
#pragma once

#include "cut/kernel/deadline_kernel.h"
#include <unseen/vdtree/internal/simd.h>

namespace unseen::vdtree {

// A deadline for every slot of every block, and the earliest ones of each block: of the slots whose verdict is to unfold,
// and of the others. The clock starts at 0 and may run to the deadline, which may be infinite. An unused clock has no
// blocks, and nothing happens to it.
class SideDeadlines {
public:
    void use(bool is_used) noexcept { is_used_ = is_used; } // only while there are no blocks
    bool is_used() const noexcept { return is_used_; }

    // The clock starts anew.
    void clear() {
        slots_.clear();
        earliest_unfolded_.clear();
        earliest_folded_.clear();
        next_ = never_due;
        set_clock(0);
    }
    void reserve(std::size_t blocks) {
        if (!is_used_) return;
        slots_.reserve(blocks);
        earliest_unfolded_.reserve(whole_registers(blocks));
        earliest_folded_.reserve(whole_registers(blocks));
    }
    // A block without deadlines.
    void push_back() {
        if (!is_used_) return;
        slots_.emplace_back();
        std::ranges::fill(slots_.back().slots, never_due);
        earliest_unfolded_.resize(whole_registers(slots_.size()), never_due);
        earliest_folded_.resize(whole_registers(slots_.size()), never_due);
    }
    void reset_earliest(std::size_t block) {
        if (is_used_) earliest_unfolded_[block] = earliest_folded_[block] = never_due;
    }

    // `slack`: what there is left from now on; 0 or more.
    void set(std::size_t block, std::size_t place, bool is_unfolded, float slack) {
        if (!is_used_) return;
        const float due = (clock_.early + slack) * just_less;
        slots_[block].slots[place] = due;
        float& of_block = (is_unfolded ? earliest_unfolded_ : earliest_folded_)[block];
        of_block = std::min(of_block, due);
        next_ = std::min(next_, due);
    }
    float left(std::size_t block, std::size_t place) const {
        return is_used_ ? std::max(slots_[block].slots[place] - clock_.early, 0.0f) : 0.0f;
    }
    void remove(std::size_t block, std::size_t place) {
        if (is_used_) slots_[block].slots[place] = never_due;
    }
    void prefetch(std::size_t block) const {
        if (is_used_) vdtree::prefetch(&slots_[block]);
    }

    void advance(double motion) { set_clock(now_ + motion); }
    bool may_be_due() const noexcept { return next_ <= clock_.late; } // false: no block is
    // Sets the clock back to 0 where it has run beyond `longest`, so that deadlines in floats stay fine enough.
    void restart(double longest) {
        if (!(now_ > longest)) return;
        const auto set_back = [&](float& due) { due = std::max(due - clock_.early, 0.0f) * just_less; };
        for (BlockSlots& dues : slots_) std::ranges::for_each(dues.slots, set_back);
        std::ranges::for_each(earliest_unfolded_, set_back);
        std::ranges::for_each(earliest_folded_, set_back);
        set_back(next_);
        set_clock(0);
    }
    const KernelClock& clock() const noexcept { return clock_; }
    // By block; for those who can prove later ones. Slots keep their own: they are handed over when the block's has
    // come.
    float* earliest_unfolded() noexcept { return earliest_unfolded_.data(); }

    // In order, in place of what was there.
    void find_due_blocks(std::vector<std::uint32_t>& blocks) {
        blocks.clear();
        next_ = never_due;
        constexpr std::size_t run = 8; // blocks looked at together: mostly none is due
        for (std::size_t first = 0; first < earliest_folded_.size(); first += run) {
            float next = never_due;
            for (std::size_t i = first; i < first + run; ++i) next = std::min(next, earliest(i));
            if (next > clock_.late) {
                next_ = std::min(next_, next);
                continue;
            }
            for (std::size_t block = first; block < first + run; ++block) {
                if (earliest(block) <= clock_.late) blocks.push_back(static_cast<std::uint32_t>(block));
                else next_ = std::min(next_, earliest(block));
            }
        }
    }
    // Makes the block's slots that are due the facing clock's: due at once by that one, and not any more by this.
    // `unfolded`: a bit a slot. Returns whether there are any.
    bool hand_over(std::size_t block, std::uint32_t unfolded, SlotDeadlines& dues) {
        const bool is_any = deadline_kernel.hand_over(clock_.late, clock_.late, unfolded, slots_[block].slots,
                                                      dues.facing, earliest_unfolded_[block], earliest_folded_[block]);
        next_ = std::min(next_, earliest(block));
        return is_any;
    }

    std::uint64_t byte_size() const noexcept { return (sizeof(BlockSlots) + 2 * sizeof(float)) * slots_.capacity(); }

private:
    struct alignas(64) BlockSlots {
        float slots[block_slots];
    };
    float earliest(std::size_t block) const { return std::min(earliest_unfolded_[block], earliest_folded_[block]); }
    void set_clock(double now) {
        now_ = now;
        clock_ = kernel_clock(now);
    }

    bool is_used_ = false;
    double now_ = 0;
    KernelClock clock_;
    std::vector<BlockSlots> slots_; // by block, like the others
    std::vector<float> earliest_unfolded_, earliest_folded_;
    float next_ = never_due; // not later than any of these
};

} // namespace unseen::vdtree
