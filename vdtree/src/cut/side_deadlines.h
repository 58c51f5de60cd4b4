// Deadlines of watched slots by a clock that only some views need: that of lights, or that of frusta.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "cut/kernel/deadline_kernel.h"
#include "cut/kernel/prefetch.h"

namespace unseen::vdtree {

// A deadline for every slot of every block, and the earliest ones of each block: of the slots whose verdict is to unfold,
// and of the others. The clock starts at 0 and may run to the deadline, which may be infinite. An unused clock has no
// blocks.
class SideDeadlines {
public:
    static constexpr float never = std::numeric_limits<float>::infinity();

    void use(bool is_used) noexcept { is_used_ = is_used; } // only while there are no blocks
    bool is_used() const noexcept { return is_used_; }

    void clear(); // the clock starts anew
    void reserve(std::size_t blocks);
    void push_back(); // a block without deadlines
    void reset_earliest(std::size_t block) { earliest_unfolded_[block] = earliest_folded_[block] = never; }

    // `slack`: what there is left from now on; 0 or more.
    void set(std::size_t block, std::size_t place, bool is_unfolded, float slack) {
        const float due = (clock_.early + slack) * just_less;
        slots_[block].slots[place] = due;
        float& earliest = (is_unfolded ? earliest_unfolded_ : earliest_folded_)[block];
        earliest = std::min(earliest, due);
    }
    float left(std::size_t block, std::size_t place) const {
        return std::max(slots_[block].slots[place] - clock_.early, 0.0f);
    }
    void remove(std::size_t block, std::size_t place) { slots_[block].slots[place] = never; }
    void prefetch(std::size_t block) const { vdtree::prefetch(&slots_[block]); }

    void advance(double motion) { set_clock(now_ + motion); }
    // Sets the clock back to 0 where it has run beyond `longest`, so that deadlines in floats stay fine enough.
    void restart(double longest);
    const KernelClock& clock() const noexcept { return clock_; }
    // By block; for those who can prove later ones. Slots keep their own: they are handed over when the block's has
    // come.
    float* earliest_unfolded() noexcept { return earliest_unfolded_.data(); }

    void find_due_blocks(std::vector<std::uint32_t>& blocks) const; // in order, in place of what was there
    // Makes the block's slots that are due the facing clock's: due at once by that one, and not any more by this.
    // `unfolded`: a bit a slot. Returns whether there are any.
    bool hand_over(std::size_t block, std::uint32_t unfolded, SlotDeadlines& dues);

    std::uint64_t byte_size() const noexcept { return (sizeof(BlockSlots) + 2 * sizeof(float)) * slots_.capacity(); }

private:
    struct alignas(64) BlockSlots {
        float slots[block_slots];
    };
    void set_clock(double now);

    bool is_used_ = false;
    double now_ = 0;
    KernelClock clock_;
    std::vector<BlockSlots> slots_; // by block, like the others
    std::vector<float> earliest_unfolded_, earliest_folded_;
};

} // namespace unseen::vdtree
