// The kernels' functions for this kind of register.

UNSEEN_INLINE void test_all(const KernelView& view, std::span<const FoldCandidate* const> lanes, TestBatch& tested) {
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

UNSEEN_INLINE void verdicts_of(const KernelView& view, std::span<const FoldCandidate* const> lanes, FoldBatch& batch) {
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

// What verdicts_of() has stored, as far as slacks and costs are made of it.
UNSEEN_INLINE Nodes stored_nodes(const FoldBatch& batch, std::size_t first) {
    Nodes of{};
    of.radius = load(batch.radius + first);
    of.length = load(batch.length + first), of.silhouette_length = load(batch.silhouette_length + first);
    of.interior_row = load(batch.interior_row + first), of.silhouette_row = load(batch.silhouette_row + first);
    return of;
}
UNSEEN_INLINE Measures stored_measures(const FoldBatch& batch, std::size_t first) {
    Measures m{};
    m.distance = load(batch.distance + first), m.gap = load(batch.gap + first),
    m.eccentricity = load(batch.eccentricity + first);
    m.bin = load(batch.bin + first);
    m.interior = load(batch.interior + first), m.silhouette = load(batch.silhouette + first);
    m.height = load(batch.height + first), m.uncovered = load(batch.uncovered + first);
    m.is_inside = mask_of(batch.is_inside, first);
    return m;
}

UNSEEN_INLINE void slacks_of_batch(const KernelView& view, const FoldBatch& batch, TestBatch& tested) {
    for (std::size_t first = 0; first < kernel_lanes; first += width) {
        const Verdicts v{mask_of(batch.unfolded, first), mask_of(batch.is_away, first),
                         mask_of(batch.is_silhouette, first), mask_of(batch.by_silhouette, first),
                         load(batch.facing_slack + first)};
        store(slacks_of(view, stored_nodes(batch, first), stored_measures(batch, first), v), tested, first);
    }
    tested.unfolded = batch.unfolded;
}

UNSEEN_INLINE void costs_of_batch(const KernelView& view, const CostTables& tables, const FoldBatch& batch, float* cost,
                                  float* seen_cost) {
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

struct Kernels {
    static void test(const KernelView& view, std::span<const FoldCandidate* const> lanes, TestBatch& tested) noexcept {
        test_all(view, lanes, tested);
    }
    static void find_verdicts(const KernelView& view, std::span<const FoldCandidate* const> lanes,
                              FoldBatch& batch) noexcept {
        verdicts_of(view, lanes, batch);
    }
    static void find_slacks(const KernelView& view, const FoldBatch& batch, TestBatch& tested) noexcept {
        slacks_of_batch(view, batch, tested);
    }
    static void find_batch_costs(const KernelView& view, const CostTables& tables, const FoldBatch& batch, float* cost,
                                 float* seen_cost) noexcept {
        costs_of_batch(view, tables, batch, cost, seen_cost);
    }
    static void decide(const KernelView& view, const NodeArrays& arrays, std::span<const NodeId> nodes,
                       std::uint64_t* unfolded) noexcept {
        decide_listed(view, arrays, nodes, unfolded);
    }
    static void decide_range(const KernelView& view, const NodeArrays& arrays, NodeId first, std::size_t count,
                             std::uint64_t* unfolded) noexcept {
        decide_run(view, arrays, first, count, unfolded);
    }
    static void find_costs(const KernelView& view, const NodeArrays& arrays, const CostTables& tables,
                           std::span<const NodeId> nodes, const NodeCosts& costs) noexcept {
        find_costs_listed(view, arrays, tables, nodes, costs);
    }
    static void find_cost_bounds(const KernelView& view, const NodeArrays& arrays, const CostTables& tables,
                                 std::span<const NodeId> nodes, float no_silhouette_over, float* cost,
                                 float* seen_cost) noexcept {
        find_bounds_listed(view, arrays, tables, nodes, no_silhouette_over, cost, seen_cost);
    }
    static void move_blocks(const float (&eye_high)[3], const float (&eye_low)[3], float path,
                            BlockSpheres& spheres) noexcept {
        move_all(eye_high, eye_low, path, spheres);
    }
    static void keep_inside(const KernelView& view, float margin, const KernelClock& clock, const BlockSpheres& spheres,
                            float* deadlines) noexcept {
        defer_inside(view, margin, clock, spheres, deadlines);
    }
    static std::size_t look_at_blocks(std::span<const std::uint32_t> which, float position_clock, float facing_clock,
                                      const SlotDeadlines* slots, const std::uint16_t* unfolded,
                                      const BlockSpheres& spheres, EarliestDeadlines& deadlines,
                                      std::uint32_t* due) noexcept {
        return look_at(which, position_clock, facing_clock, slots, unfolded, spheres, deadlines, due);
    }
    static void find_deadlines(const TestBatch& tested, DeadlineBatch& batch) noexcept { deadlines_of(tested, batch); }
    static void find_due_blocks(float position_clock, float facing_clock, const BlockSpheres& spheres,
                                const EarliestDeadlines& deadlines, std::uint64_t* due) noexcept {
        due_blocks_of(position_clock, facing_clock, spheres, deadlines, due);
    }
};

constexpr Kernel table{
    Kernels::test,           Kernels::find_verdicts, Kernels::find_slacks,    Kernels::find_batch_costs,
    Kernels::decide,         Kernels::decide_range,  Kernels::find_costs,     Kernels::find_cost_bounds,
    Kernels::move_blocks,    Kernels::keep_inside,   Kernels::look_at_blocks, Kernels::find_deadlines,
    Kernels::find_due_blocks};
