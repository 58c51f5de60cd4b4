#include "cut/kernel/fold_kernel.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <numbers>

#include "cut/kernel/deadline_kernel.h"
#include "cut/kernel/prefetch.h"
#include <unseen/vdtree/internal/simd.h>

namespace unseen::vdtree {

namespace {

// What both kernels' headers declare, as one kind of register has it.
struct Kernel {
    decltype(&vdtree::test) test;
    decltype(&vdtree::find_verdicts) find_verdicts;
    decltype(&vdtree::find_slacks) find_slacks;
    void (*find_batch_costs)(const KernelView&, const CostTables&, const FoldBatch&, float*, float*) noexcept;
    decltype(&vdtree::decide) decide;
    decltype(&vdtree::decide_range) decide_range;
    void (*find_costs)(const KernelView&, const NodeArrays&, const CostTables&, std::span<const NodeId>,
                       const NodeCosts&) noexcept;
    decltype(&vdtree::find_cost_bounds) find_cost_bounds;
    decltype(&vdtree::move_blocks) move_blocks;
    decltype(&vdtree::keep_inside) keep_inside;
    decltype(&vdtree::look_at_blocks) look_at_blocks;
    decltype(&vdtree::find_deadlines) find_deadlines;
    decltype(&vdtree::find_due_blocks) find_due_blocks;
};

// GCC takes vectors apart that it meets in functions for others, even where these are inlined. So the arithmetic is
// included once for each kind of register, as a whole, within the region that is compiled for it. (With registers of
// sixteen floats, tests from the cache take four fifths of the time, but frames and jumps take as long.)
namespace four_wide {

using Vectors = FourWide;
#include "cut/kernel/lanes.h"

#include "cut/kernel/measure.h"

#include "cut/kernel/facing.h"

#include "cut/kernel/load.h"

#include "cut/kernel/decide.h"

#include "cut/kernel/slacks.h"

#include "cut/kernel/costs.h"

#include "cut/kernel/deadlines.h"

#include "cut/kernel/table.h"

} // namespace four_wide

#if defined(UNSEEN_EIGHT_WIDE)
#pragma GCC push_options
#pragma GCC target("avx2")
namespace eight_wide {

using Vectors = EightWide;
#include "cut/kernel/lanes.h"

#include "cut/kernel/measure.h"

#include "cut/kernel/facing.h"

#include "cut/kernel/load.h"

#include "cut/kernel/decide.h"

#include "cut/kernel/slacks.h"

#include "cut/kernel/costs.h"

#include "cut/kernel/deadlines.h"

#include "cut/kernel/table.h"

} // namespace eight_wide
#pragma GCC pop_options
#endif

Kernel best_kernel() {
#if defined(UNSEEN_EIGHT_WIDE)
    if (has_avx2()) return eight_wide::table;
#endif
    return four_wide::table;
}
const Kernel kernel = best_kernel();

} // namespace

void test(const KernelView& view, std::span<const FoldCandidate* const> lanes, TestBatch& tested) noexcept {
    kernel.test(view, lanes, tested);
}

void find_verdicts(const KernelView& view, std::span<const FoldCandidate* const> lanes, FoldBatch& batch) noexcept {
    kernel.find_verdicts(view, lanes, batch);
}

void find_slacks(const KernelView& view, const FoldBatch& batch, TestBatch& tested) noexcept {
    kernel.find_slacks(view, batch, tested);
}

void find_costs(const KernelView& view, const CostTables& tables, const FoldBatch& batch, float* cost,
                float* seen_cost) noexcept {
    kernel.find_batch_costs(view, tables, batch, cost, seen_cost);
}

void decide(const KernelView& view, const NodeArrays& arrays, std::span<const NodeId> nodes,
            std::uint64_t* unfolded) noexcept {
    kernel.decide(view, arrays, nodes, unfolded);
}

void decide_range(const KernelView& view, const NodeArrays& arrays, NodeId first, std::size_t count,
                  std::uint64_t* unfolded) noexcept {
    kernel.decide_range(view, arrays, first, count, unfolded);
}

void find_costs(const KernelView& view, const NodeArrays& arrays, const CostTables& tables,
                std::span<const NodeId> nodes, const NodeCosts& costs) noexcept {
    kernel.find_costs(view, arrays, tables, nodes, costs);
}

void find_cost_bounds(const KernelView& view, const NodeArrays& arrays, const CostTables& tables,
                      std::span<const NodeId> nodes, float no_silhouette_over, float* cost, float* seen_cost) noexcept {
    kernel.find_cost_bounds(view, arrays, tables, nodes, no_silhouette_over, cost, seen_cost);
}

void move_blocks(const float (&eye_high)[3], const float (&eye_low)[3], float path, BlockSpheres& spheres) noexcept {
    kernel.move_blocks(eye_high, eye_low, path, spheres);
}

void keep_inside(const KernelView& view, float margin, const KernelClock& clock, const BlockSpheres& spheres,
                 float* deadlines) noexcept {
    kernel.keep_inside(view, margin, clock, spheres, deadlines);
}

std::size_t look_at_blocks(std::span<const std::uint32_t> which, float position_clock, float facing_clock,
                           const SlotDeadlines* dues, const std::uint16_t* unfolded, const BlockSpheres& spheres,
                           EarliestDeadlines& deadlines, std::uint32_t* due) noexcept {
    return kernel.look_at_blocks(which, position_clock, facing_clock, dues, unfolded, spheres, deadlines, due);
}

void find_deadlines(const TestBatch& tested, DeadlineBatch& dues) noexcept { kernel.find_deadlines(tested, dues); }

void find_due_blocks(float position_clock, float facing_clock, const BlockSpheres& spheres,
                     const EarliestDeadlines& deadlines, std::uint64_t* due) noexcept {
    kernel.find_due_blocks(position_clock, facing_clock, spheres, deadlines, due);
}

} // namespace unseen::vdtree
