// Verdicts: whether nodes unfold.

// The one place where that is decided, for masks of lanes and for words of bits: within the interior's distance
// everything unfolds, and within the silhouette's distance what is one; but nothing that faces away.
template <class Mask>
UNSEEN_INLINE Mask unfolds(const Mask& is_near, const Mask& is_within_silhouette, const Mask& is_silhouette,
                           const Mask& is_away) {
    return (is_near | (is_silhouette & is_within_silhouette)) & ~is_away;
}

// Whether back faces fold, and all of them are.
UNSEEN_INLINE Ints is_away(const KernelView& view, const Sides& sides) {
    return view.near_ones_too ? sides.back : Ints{};
}

struct Verdicts {
    Ints unfolded;
    Ints away;          // folded for facing away
    Ints is_silhouette; // as far as that was asked
    Ints by_silhouette; // whose verdict goes by the silhouette's distance
    Floats facing;      // slack
};

// The verdicts on records of nodes, with what facing leaves of slack.
UNSEEN_INLINE Verdicts decided(const KernelView& view, const Candidates& of, const Measures& m) {
    Verdicts v{m.is_inside & m.is_near, Ints{}, ~m.is_near, ~m.is_near, all(std::numeric_limits<float>::infinity())};
    if (!any(m.is_asked)) return v;
    const Floats always = v.facing;
    Floats towards[3];
    for (int k = 0; k < 3; ++k) towards[k] = (view.eye_high[k] - of.ring[k]) + view.eye_low[k];
    const Gaps gaps = find_gaps<false>(towards, of.ring_radius, Ints{},
                                       [&](std::size_t axis) UNSEEN_INLINE_LAMBDA { return of.words.slab(axis); });
    // An irregular ring is a silhouette from everywhere; what has no triangle with an area faces everything.
    const Ints is_irregular = of.words.is_irregular(), is_empty = of.words.is_empty();
    const Floats &shown = view.is_inside_out ? gaps.back : gaps.front,
                 &hidden = view.is_inside_out ? gaps.front : gaps.back;
    const Floats front = is_irregular ? -always : is_empty ? always : shown;
    const Floats back = (is_irregular | is_empty) ? -always : hidden;
    const Sides sides{front > 0, back > 0};
    const Ints is_silhouette = sides.is_silhouette(), away = is_away(view, sides);
    v.away = m.is_asked & away;
    v.unfolded = m.is_asked ? unfolds<Ints>(m.is_near, m.gap < m.silhouette, is_silhouette, away) : v.unfolded;
    v.is_silhouette = m.is_asked ? is_silhouette : v.is_silhouette;
    v.by_silhouette = m.is_asked ? is_silhouette & ~m.is_near : v.by_silhouette;
    // Within the interior's distance nothing but facing away folds it.
    const Floats near = view.near_ones_too ? -back : always;
    const Floats far = is_silhouette ? min_of(-front, -back) : max_of(front, back);
    v.facing = m.is_asked ? (v.away ? back : m.is_near ? near : far) : always;
    return v;
}

// ---- many nodes, without slacks

// What nodes face that have to be asked, a register of them at a time: calls f(i, is_silhouette, is_away), the last two
// 0 or 1, for the `count` places i in `asked`, which has room for a register more. Nodes by place: at(i).
template <class At, class F>
UNSEEN_INLINE void for_each_asked(const KernelView& view, const NodeArrays& arrays, std::uint16_t* asked,
                                  std::size_t count, At at, F f) {
    std::fill_n(asked + count, width, count > 0 ? asked[0] : std::uint16_t{0});
    for (std::size_t first = 0; first < count; first += width) {
        const Sides sides =
            sides_of(view, arrays, [&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return at(asked[first + lane]); });
        const std::uint32_t silhouettes = bits_of(sides.is_silhouette()), away = bits_of(is_away(view, sides));
        for (std::size_t lane = 0; lane < std::min(width, count - first); ++lane)
            f(std::size_t{asked[first + lane]}, (silhouettes >> lane) & 1, (away >> lane) & 1);
    }
}

// Collects the nodes of each piece whose facing matters and tests them together, so that all lanes are used.
template <class NodeAt>
UNSEEN_INLINE void decide_all(const KernelView& view, const NodeArrays& arrays, std::size_t count, NodeAt node_at,
                              std::uint64_t* unfolded) {
    constexpr std::size_t piece = 512, words = piece / 64;
    for (std::size_t start = 0; start < count; start += piece, unfolded += words) {
        const std::size_t size = std::min(piece, count - start);
        std::uint64_t near[words];
        std::uint16_t asked[piece + width];
        std::size_t asked_count = 0;
        for (std::size_t first = 0; first < size; first += 64) {
            const std::size_t end = std::min(first + 64, size);
            std::uint64_t seen_bits = 0, near_bits = 0, asked_bits = 0;
            for (std::size_t i = first; i < end; i += width) {
                node_at.prefetch(start + i);
                const auto at = [&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return node_at(start + i + lane); };
                const Measures m = measures_of(view, load_nodes(view, arrays, at));
                near_bits |= std::uint64_t{bits_of(m.is_near)} << (i - first);
                seen_bits |= std::uint64_t{bits_of(m.is_near & m.is_inside)} << (i - first);
                if (any(m.is_asked)) asked_bits |= std::uint64_t{bits_of(m.is_asked)} << (i - first);
            }
            const std::uint64_t used = end - first < 64 ? (std::uint64_t{1} << (end - first)) - 1 : ~std::uint64_t{0};
            near[first / 64] = near_bits;
            unfolded[first / 64] = seen_bits & used;
            for (asked_bits &= used; asked_bits; asked_bits &= asked_bits - 1)
                asked[asked_count++] =
                    static_cast<std::uint16_t>(first + static_cast<std::size_t>(std::countr_zero(asked_bits)));
        }
        const auto at = [&](std::size_t i) UNSEEN_INLINE_LAMBDA { return node_at(start + i); };
        for_each_asked(view, arrays, asked, asked_count, at,
                       [&](std::size_t i, std::uint32_t silhouette, std::uint32_t away) UNSEEN_INLINE_LAMBDA {
                           const std::size_t word = i / 64, bit = i % 64;
                           // Only what is within the silhouette's distance is asked.
                           const std::uint64_t seen =
                               unfolds<std::uint64_t>(near[word] >> bit, 1, silhouette, away) & 1;
                           unfolded[word] = (unfolded[word] & ~(std::uint64_t{1} << bit)) | (seen << bit);
                       });
    }
}

void decide(const KernelView& view, const NodeArrays& arrays, std::span<const NodeId> nodes,
            std::uint64_t* unfolded) noexcept {
    decide_all(view, arrays, nodes.size(), Listed{arrays, nodes.data(), nodes.size() - 1}, unfolded);
}

void decide_range(const KernelView& view, const NodeArrays& arrays, NodeId start, std::size_t count,
                  std::uint64_t* unfolded) noexcept {
    struct Range {
        std::size_t start;
        UNSEEN_INLINE std::size_t operator()(std::size_t i) const { return start + i; }
        UNSEEN_INLINE void prefetch(std::size_t) const {}
    };
    // Whole registers only; what is left goes node by node.
    const std::size_t whole = count / 64 * 64;
    decide_all(view, arrays, whole, Range{start}, unfolded);
    if (whole == count) return;
    NodeId rest[64];
    for (std::size_t i = 0; i < count - whole; ++i) rest[i] = static_cast<NodeId>(start + whole + i);
    decide(view, arrays, std::span(rest, count - whole), unfolded + whole / 64);
}
