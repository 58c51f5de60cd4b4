// Costs of folds: the thresholds at which nodes would just fold.

struct Costs {
    Floats cost, seen; // without and with the least cost of the row
};
// By one row of the criterion's own tables: the distance within which the node unfolds at the threshold 1, over its
// gap.
UNSEEN_INLINE Costs costs_of(const KernelView& view, const CostTables& tables, const Ints& row, const Measures& m,
                             const Floats& unit) {
    const Floats switch_distance = entries(view, tables.switch_distance, row, m.bin), length = unit * switch_distance;
    const Ints seldom = (switch_distance < 0) | ((length <= 0) & (m.gap > 0)); // from nowhere, or from inside only
    const Ints always = (switch_distance >= DistanceCriterion::always_visible) | (m.gap <= 0);
    const Floats cost = always ? all(std::numeric_limits<float>::infinity()) : length / m.gap;
    Costs costs{seldom ? all(0) : cost, {}};
    costs.seen = costs.cost;
    if (tables.least_cost) costs.seen = seldom ? all(0) : max_of(cost, entries(view, tables.least_cost, row, m.bin));
    return costs;
}

// As a silhouette's, which are the larger ones; of the interior where both are the same.
UNSEEN_INLINE Costs silhouette_costs(const KernelView& view, const CostTables& tables, const Nodes& of,
                                     const Measures& m, const Costs& inner) {
    const Costs own = costs_of(view, tables, of.silhouette_row, m, of.silhouette_length);
    return {max_of(inner.cost, own.cost), max_of(inner.seen, own.seen)};
}

// The one place where it is chosen which of two findings holds for what a node faces, for lanes and for single nodes.
template <class Mask, class Cost>
UNSEEN_INLINE Cost as_seen(const Mask& is_silhouette, const Mask& is_away, const Cost& interior,
                           const Cost& silhouette) {
    return is_away ? Cost{} : is_silhouette ? silhouette : interior;
}

void find_cost_bounds(const KernelView& view, const NodeArrays& arrays, const CostTables& tables,
                      std::span<const NodeId> nodes, float no_silhouette_over, float* cost, float* seen) noexcept {
    const Listed listed{arrays, nodes.data(), nodes.size() - 1};
    for (std::size_t i = 0; i < nodes.size(); i += width) {
        listed.prefetch(i);
        const Nodes of =
            load_nodes(view, arrays, [&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return listed(i + lane); });
        const Measures m = measures_of(view, of);
        const Costs inner = costs_of(view, tables, of.interior_row, m, of.length),
                    silhouette = silhouette_costs(view, tables, of, m, inner);
        const Ints is_none = silhouette.cost > no_silhouette_over;
        const Floats bound = m.is_inside ? (is_none ? inner.cost : silhouette.cost) : all(0);
        const Floats seen_bound = m.is_inside ? (is_none ? inner.seen : silhouette.seen) : all(0);
        if (i + width <= nodes.size()) {
            store(cost + i, bound);
            store(seen + i, seen_bound);
        } else {
            for (std::size_t lane = 0; i + lane < nodes.size(); ++lane)
                cost[i + lane] = bound[lane], seen[i + lane] = seen_bound[lane];
        }
    }
}

// Like decide_all().
void find_costs(const KernelView& view, const NodeArrays& arrays, const CostTables& tables,
                std::span<const NodeId> nodes, const NodeCosts& out) noexcept {
    constexpr std::size_t piece = 256;
    const Listed listed{arrays, nodes.data(), nodes.size() - 1};
    for (std::size_t start = 0; start < nodes.size(); start += piece) {
        const std::size_t size = std::min(piece, nodes.size() - start);
        // Costs as interior, and as silhouette for nodes that may be one.
        alignas(64) float cost[piece + width], seen[piece + width], silhouette_cost[piece + width],
            silhouette_seen[piece + width];
        std::uint8_t unfolded[piece + width], silhouette_unfolded[piece + width];
        std::uint16_t asked[piece + width];
        std::size_t asked_count = 0;
        for (std::size_t i = 0; i < size; i += width) {
            listed.prefetch(start + i);
            const Nodes of = load_nodes(
                view, arrays, [&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return listed(start + i + lane); });
            const Measures m = measures_of(view, of);
            const Costs inner = costs_of(view, tables, of.interior_row, m, of.length);
            const Costs silhouette = silhouette_costs(view, tables, of, m, inner);
            store(cost + i, m.is_inside ? inner.cost : all(0));
            store(seen + i, m.is_inside ? inner.seen : all(0));
            store(silhouette_cost + i, silhouette.cost);
            store(silhouette_seen + i, silhouette.seen);
            const Ints none = {}, within = m.gap < m.silhouette;
            const std::uint32_t as_interior = bits_of(unfolds<Ints>(m.is_near, within, none, ~m.is_inside));
            const std::uint32_t as_silhouette = bits_of(unfolds<Ints>(m.is_near, within, ~none, ~m.is_inside));
            const std::uint32_t asked_bits = bits_of(m.is_asked);
            for (std::size_t lane = 0; lane < width; ++lane) {
                unfolded[i + lane] = (as_interior >> lane) & 1;
                silhouette_unfolded[i + lane] = (as_silhouette >> lane) & 1;
                asked[asked_count] = static_cast<std::uint16_t>(i + lane);
                asked_count += (asked_bits >> lane) & 1 & (i + lane < size);
            }
        }
        const auto at = [&](std::size_t i) UNSEEN_INLINE_LAMBDA { return listed(start + i); };
        for_each_asked(view, arrays, asked, asked_count, at,
                       [&](std::size_t i, std::uint32_t silhouette, std::uint32_t away) UNSEEN_INLINE_LAMBDA {
                           if (!(silhouette | away)) return; // as most are
                           cost[i] = as_seen(silhouette, away, cost[i], silhouette_cost[i]);
                           seen[i] = as_seen(silhouette, away, seen[i], silhouette_seen[i]);
                           unfolded[i] = as_seen(silhouette, away, unfolded[i], silhouette_unfolded[i]);
                       });
        std::copy_n(cost, size, out.cost + start);
        std::copy_n(seen, size, out.seen_cost + start);
        for (std::size_t first = 0; first < size; first += 64) {
            std::uint64_t bits = 0;
            for (std::size_t i = first; i < std::min(first + 64, size); ++i)
                bits |= std::uint64_t{unfolded[i]} << (i - first);
            out.unfolded[(start + first) / 64] = bits;
        }
    }
}
