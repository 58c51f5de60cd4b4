#include "cut/side_deadlines.h"

#include <cstring>

#include <unseen/vdtree/internal/simd.h>

namespace unseen::vdtree {

void SideDeadlines::clear() {
    slots_.clear();
    earliest_unfolded_.clear();
    earliest_folded_.clear();
    set_clock(0);
}

void SideDeadlines::reserve(std::size_t blocks) {
    slots_.reserve(blocks);
    earliest_unfolded_.reserve(blocks);
    earliest_folded_.reserve(blocks);
}

void SideDeadlines::push_back() {
    slots_.emplace_back();
    std::ranges::fill(slots_.back().slots, never);
    earliest_unfolded_.push_back(never);
    earliest_folded_.push_back(never);
}

void SideDeadlines::set_clock(double now) {
    now_ = now;
    clock_ = kernel_clock(now);
}

void SideDeadlines::restart(double longest) {
    if (!(now_ > longest)) return;
    const auto set_back = [&](float& due) { due = std::max(due - clock_.early, 0.0f) * just_less; };
    for (BlockSlots& dues : slots_) std::ranges::for_each(dues.slots, set_back);
    std::ranges::for_each(earliest_unfolded_, set_back);
    std::ranges::for_each(earliest_folded_, set_back);
    set_clock(0);
}

void SideDeadlines::find_due_blocks(std::vector<std::uint32_t>& blocks) const {
    blocks.clear();
    constexpr std::size_t run = 16; // blocks looked at together: mostly none is due
    for (std::size_t first = 0; first < slots_.size(); first += run) {
        const std::size_t end = std::min(first + run, slots_.size());
        const auto is_due = [&](std::size_t block) {
            return static_cast<unsigned>(earliest_unfolded_[block] <= clock_.late) |
                   static_cast<unsigned>(earliest_folded_[block] <= clock_.late);
        };
        unsigned any = 0;
        for (std::size_t block = first; block < end; ++block) any |= is_due(block);
        if (!any) continue;
        for (std::size_t block = first; block < end; ++block)
            if (is_due(block)) blocks.push_back(static_cast<std::uint32_t>(block));
    }
}

bool SideDeadlines::hand_over(std::size_t block, std::uint32_t unfolded, SlotDeadlines& dues) {
    using Floats = FourWide::Floats;
    using Ints = FourWide::Ints;
    const Floats none = Floats{} + never;
    Floats earliest_unfolded = none, earliest_folded = none;
    bool any = false;
    for (std::size_t i = 0; i < block_slots; i += 4) {
        Floats due, facing;
        std::memcpy(&due, &slots_[block].slots[i], sizeof due);
        std::memcpy(&facing, &dues.facing[i], sizeof facing);
        const auto is_due = due <= clock_.late;
        any |= (is_due[0] | is_due[1] | is_due[2] | is_due[3]) != 0;
        facing = is_due ? -none : facing;
        due = is_due ? none : due;
        const auto unfolds = ((Ints{} + static_cast<std::int32_t>(unfolded >> i)) & Ints{1, 2, 4, 8}) != 0;
        const Floats of_unfolded = unfolds ? due : none, of_folded = unfolds ? none : due;
        earliest_unfolded = of_unfolded < earliest_unfolded ? of_unfolded : earliest_unfolded;
        earliest_folded = of_folded < earliest_folded ? of_folded : earliest_folded;
        std::memcpy(&slots_[block].slots[i], &due, sizeof due);
        std::memcpy(&dues.facing[i], &facing, sizeof facing);
    }
    earliest_unfolded_[block] = FourWide::least_of(earliest_unfolded);
    earliest_folded_[block] = FourWide::least_of(earliest_folded);
    return any;
}

} // namespace unseen::vdtree
