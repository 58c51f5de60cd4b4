// All of the kernels' arithmetic in one kind of register, and the tables of their functions.

#include "cut/kernel/lanes.h"

#include "cut/kernel/measure.h"

#include "cut/kernel/facing.h"

#include "cut/kernel/load.h"

#include "cut/kernel/decide.h"

#include "cut/kernel/slacks.h"

#include "cut/kernel/costs.h"

#include "cut/kernel/deadlines.h"

void test(const KernelView& view, std::span<const FoldCandidate* const> lanes, TestBatch& tested) noexcept {
    tested.unfolded = 0;
    for (std::size_t first = 0; first < lanes.size(); first += width) {
        const Candidates of = load_candidates(view, [&](std::size_t lane) UNSEEN_INLINE_LAMBDA {
            return lanes[std::min(first + lane, lanes.size() - 1)];
        });
        const Measures m = measures_of(view, of.nodes);
        const Verdicts v = decided(view, of, m);
        store(slacks_of(view, of.nodes, m, v), tested, first);
        tested.unfolded |= bits_of(v.unfolded) << first;
    }
}

void find_verdicts(const KernelView& view, std::span<const FoldCandidate* const> lanes, FoldBatch& batch) noexcept {
    batch.is_inside = batch.is_near = batch.unfolded = batch.is_silhouette = batch.by_silhouette = batch.is_away = 0;
    for (std::size_t first = 0; first < kernel_lanes; first += width) {
        // Unused lanes repeat the last candidate.
        const Candidates of = load_candidates(view, [&](std::size_t lane) UNSEEN_INLINE_LAMBDA {
            return lanes[std::min(first + lane, lanes.size() - 1)];
        });
        const Measures m = measures_of(view, of.nodes);
        const Verdicts v = decided(view, of, m);
        store(batch.radius + first, of.nodes.radius);
        store(batch.length + first, of.nodes.length);
        store(batch.silhouette_length + first, of.nodes.silhouette_length);
        store(batch.interior_row + first, of.nodes.interior_row);
        store(batch.silhouette_row + first, of.nodes.silhouette_row);
        store(batch.distance + first, m.distance);
        store(batch.gap + first, m.gap);
        store(batch.angle + first, m.angle);
        store(batch.eccentricity + first, m.eccentricity);
        store(batch.bin + first, m.bin);
        store(batch.interior + first, m.interior);
        store(batch.silhouette + first, m.silhouette);
        store(batch.height + first, m.height);
        store(batch.uncovered + first, m.uncovered);
        store(batch.facing_slack + first, v.facing);
        batch.is_inside |= bits_of(m.is_inside) << first;
        batch.is_near |= bits_of(m.is_near) << first;
        batch.unfolded |= bits_of(v.unfolded) << first;
        batch.is_silhouette |= bits_of(v.is_silhouette) << first;
        batch.by_silhouette |= bits_of(v.by_silhouette) << first;
        batch.is_away |= bits_of(v.away) << first;
    }
}

// What find_verdicts() has stored, as far as slacks and costs are made of it.
UNSEEN_INLINE Nodes stored_nodes(const FoldBatch& batch, std::size_t first) {
    Nodes of{};
    of.radius = load(batch.radius + first);
    of.length = load(batch.length + first), of.silhouette_length = load(batch.silhouette_length + first);
    of.interior_row = load(batch.interior_row + first), of.silhouette_row = load(batch.silhouette_row + first);
    return of;
}
UNSEEN_INLINE Measures stored_measures(const FoldBatch& batch, std::size_t first) {
    Measures m{};
    m.distance = load(batch.distance + first), m.gap = load(batch.gap + first);
    m.angle = load(batch.angle + first), m.eccentricity = load(batch.eccentricity + first);
    m.bin = load(batch.bin + first);
    m.interior = load(batch.interior + first), m.silhouette = load(batch.silhouette + first);
    m.height = load(batch.height + first), m.uncovered = load(batch.uncovered + first);
    m.is_inside = mask_of(batch.is_inside, first);
    return m;
}

void find_slacks(const KernelView& view, const FoldBatch& batch, TestBatch& tested) noexcept {
    for (std::size_t first = 0; first < kernel_lanes; first += width) {
        const Verdicts v{mask_of(batch.unfolded, first), mask_of(batch.is_away, first),
                         mask_of(batch.is_silhouette, first), mask_of(batch.by_silhouette, first),
                         load(batch.facing_slack + first)};
        store(slacks_of(view, stored_nodes(batch, first), stored_measures(batch, first), v), tested, first);
    }
    tested.unfolded = batch.unfolded;
}

void find_batch_costs(const KernelView& view, const CostTables& tables, const FoldBatch& batch, float* cost,
                      float* seen_cost) noexcept {
    for (std::size_t first = 0; first < kernel_lanes; first += width) {
        const Nodes of = stored_nodes(batch, first);
        const Measures m = stored_measures(batch, first);
        const Costs inner = costs_of(view, tables, of.interior_row, m, of.length),
                    silhouette = silhouette_costs(view, tables, of, m, inner);
        const Ints is_silhouette = mask_of(batch.is_silhouette, first),
                   folded = ~m.is_inside | mask_of(batch.is_away, first);
        store(cost + first, as_seen(is_silhouette, folded, inner.cost, silhouette.cost));
        store(seen_cost + first, as_seen(is_silhouette, folded, inner.seen, silhouette.seen));
    }
}

constexpr FoldKernel fold_table{test,   find_verdicts, find_slacks, find_batch_costs,
                                decide, decide_range,  find_costs,  find_cost_bounds};
constexpr DeadlineKernel deadline_table{move_blocks,    turn_blocks, keep_inside,    look_at_blocks,
                                        find_deadlines, hand_over,   find_due_blocks};
