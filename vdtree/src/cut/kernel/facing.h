// What rings face: how far the eye may move while everything in a ring still faces it, or still faces away.
//
// The directions of a ring's triangles lie in slabs (NormalSlabs), a least and a largest coordinate along seven axes.
// Any three independent slabs make a parallelepiped P around the directions; tried are the box of x, y and z and the
// twelve with a diagonal in place of one of these. P proves that everything faces the eye, from all of the ring's sphere, if
//
//     min over x in P of x . (eye - centre)  >  radius * reach,      reach: the longest vector in P;
//
// over reach, the difference of both sides is the way that the eye may go meanwhile. Likewise with the maximum for
// facing away. A node without a proof has no ancestor with one, for an ancestor's P and sphere contain the node's.

constexpr float slab_units = 127;            // of NormalSlabs in 1
constexpr float sqrt3 = 1.7320508075688772f; // of the diagonals' coordinates
// 1 / sqrt(s) from below, for squares s of lengths in units of slabs: tangents at 1.2 and 2, and its value at the longest
// vector that any parallelepiped holds (a diagonal's replaced coordinate of up to sqrt(3) + 2, and two of 1).
struct Tangent {
    float at_0, slope;
};
constexpr Tangent tangent_of(double root) {        // at the square of `root`
    constexpr double units = 127, less = 1 - 1e-6; // covers the rounding of the products
    return {static_cast<float>(1.5 / (root * units) * less),
            static_cast<float>(0.5 / (root * root * root * units * units * units))};
}
constexpr Tangent near_tangent = tangent_of(1.0954), middle_tangent = tangent_of(1.4142);
constexpr float least_inverse_reach = 0.25f / slab_units;
// Rounding of products and their sums, as a share of the distance: a dozen roundings of terms a few times its size.
constexpr float product_rounding = 1e-5f;

struct Interval {
    Floats lo, hi;
};
// Values of weight * slab.
UNSEEN_INLINE Interval scaled(const Interval& slab, const Floats& weight) {
    const Floats a = weight * slab.lo, b = weight * slab.hi;
    return {min_of(a, b), max_of(a, b)};
}
// Values of 1 or -1 times the slab.
UNSEEN_INLINE Interval turned(const Interval& slab, float sign) {
    return sign > 0 ? slab : Interval{-slab.hi, -slab.lo};
}

// Not more than 1 over the root of a squared reach of a parallelepiped, and falling with it: tangents, for the curve is
// convex.
UNSEEN_INLINE Floats inverse_reach(const Floats& squared) {
    const Floats near =
        max_of(near_tangent.at_0 - near_tangent.slope * squared, middle_tangent.at_0 - middle_tangent.slope * squared);
    return max_of(near, all(least_inverse_reach));
}

// Keeps the best of the parallelepipeds: the largest minimum, and the smallest maximum, each over the length that
// vectors may have there.
struct Best {
    Floats least, largest;
    UNSEEN_INLINE void offer(const Floats& low, const Floats& high, const Floats& squared_reach) {
        const Floats shorter = inverse_reach(squared_reach);
        least = max_of(least, low * shorter);
        largest = min_of(largest, high * shorter);
    }
};

// The eye's ways while everything faces it (front), or faces away (back); mesh units. Not positive: not everything
// does; then it is minus the way after which everything might.
struct Gaps {
    Floats front, back;
};
// With `signs_only` as soon as one of both is positive for all of the `asked` lanes; then only that counts.
template <bool signs_only, class SlabOf>
UNSEEN_INLINE Gaps find_gaps(const Floats (&e)[3], const Floats& radius, const Ints& asked, SlabOf slab_of) {
    const Interval slab[3] = {slab_of(0), slab_of(1), slab_of(2)};
    const Floats distance = abs_of(e[0]) + abs_of(e[1]) + abs_of(e[2]); // an upper bound
    Floats squared[3];
    Interval along[3];
    for (int k = 0; k < 3; ++k) {
        const Floats reach = max_of(abs_of(slab[k].lo), abs_of(slab[k].hi));
        squared[k] = reach * reach;
        along[k] = scaled(slab[k], e[k]);
    }
    Best best{all(-1e30f), all(1e30f)};
    best.offer(along[0].lo + along[1].lo + along[2].lo, along[0].hi + along[1].hi + along[2].hi,
               squared[0] + squared[1] + squared[2]);
    const Floats needed = radius + distance * product_rounding;
    constexpr float plenty = 0.125f; // of the distance
    const auto gaps = [&]() UNSEEN_INLINE_LAMBDA { return Gaps{best.least - needed, -best.largest - needed}; };
    const auto is_proved = [&](const Gaps& found)
                               UNSEEN_INLINE_LAMBDA { return !any(asked & ~((found.front > 0) | (found.back > 0))); };
    if constexpr (signs_only) {
        const Gaps found = gaps();
        if (is_proved(found)) return found;
    } else {
        // Where the box alone proves everything, with much to spare, the rest would only add to that.
        const Floats spare = needed + distance * plenty;
        if (!any(~((best.least > spare) | (-best.largest > spare)))) return gaps();
    }
    constexpr float signs[4][3] = {{1, 1, 1}, {-1, 1, 1}, {1, -1, 1}, {1, 1, -1}};
#pragma GCC unroll 4
    for (std::size_t d = 0; d < 4; ++d) {
        const Interval diagonal = slab_of(3 + d);
#pragma GCC unroll 3
        for (int k = 0; k < 3; ++k) {
            // The diagonal in place of axis k: e = weight * diagonal + rest along i and j.
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            const float sk = signs[d][k], si = signs[d][i], sj = signs[d][j];
            const Floats weight = e[k] * sk;
            const Interval a = scaled(diagonal, weight * sqrt3), b = scaled(slab[i], e[i] - weight * si),
                           c = scaled(slab[j], e[j] - weight * sj);
            // The replaced coordinate, sk * (sqrt3 * diagonal - si * x_i - sj * x_j), is in this interval.
            const Interval bi = turned(slab[i], si), bj = turned(slab[j], sj);
            const Floats high = diagonal.hi * sqrt3 - bi.lo - bj.lo, low = diagonal.lo * sqrt3 - bi.hi - bj.hi;
            const Floats reach = max_of(abs_of(low), abs_of(high));
            best.offer(a.lo + b.lo + c.lo, a.hi + b.hi + c.hi, reach * reach + squared[i] + squared[j]);
        }
        if constexpr (signs_only) {
            const Gaps found = gaps();
            if (is_proved(found)) return found;
        }
    }
    return gaps();
}

// The sixteen bytes from a node's slabs on, four to an int: lo of the seven axes, then hi, and the node's flags.
struct Words {
    Ints four[4];
    template <std::size_t at>
    UNSEEN_INLINE Ints byte() const { // as a signed number
        return (four[at / 4] << (24 - 8 * (at % 4))) >> 24;
    }
    UNSEEN_INLINE Ints is_irregular() const { return (byte<14>() & std::int32_t{irregular_ring}) != 0; }
    // No triangle with an area.
    UNSEEN_INLINE Ints is_empty() const { return byte<0>() > byte<NormalSlabs::axis_count>(); }
    UNSEEN_INLINE Interval slab(std::size_t axis) const {
        const auto byte_at = [&](std::size_t at) UNSEEN_INLINE_LAMBDA {
            return __builtin_convertvector((four[at / 4] << static_cast<int>(24 - 8 * (at % 4))) >> 24, Floats);
        };
        return {byte_at(axis), byte_at(NormalSlabs::axis_count + axis)};
    }
};

// The sides that rings show, as masks: everything faces the eye (front), or faces away (back).
struct Sides {
    Ints front, back;
    UNSEEN_INLINE Ints is_silhouette() const { return ~(front | back); }
};
// The sides of nodes at places of the arrays. Only the signs count.
template <class At>
UNSEEN_INLINE Sides sides_of(const KernelView& view, const NodeArrays& arrays, At at) {
    Floats ring[4], towards[3], columns[4];
    Vectors::load_columns([&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return &arrays.bounds[at(lane)].ring; }, ring);
    for (int k = 0; k < 3; ++k) towards[k] = (view.eye_high[k] - ring[k]) + view.eye_low[k];
    Vectors::load_columns([&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return &arrays.bounds[at(lane)].slabs; },
                          columns);
    static_assert(offsetof(NodeBounds, slabs) == 16 && offsetof(NodeBounds, flags) == 30 && sizeof(NodeBounds) == 32);
    Words words;
    std::memcpy(words.four, columns, sizeof columns);
    const Ints is_irregular = words.is_irregular();
    if (arrays.facing) {
        float slabs[width][4] = {}; // the last two bytes are of no slab
        for (std::size_t lane = 0; lane < width; ++lane)
            std::memcpy(slabs[lane], &arrays.facing[at(lane)], sizeof(NormalSlabs));
        Vectors::load_columns([&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return slabs[lane]; }, columns);
        std::memcpy(words.four, columns, sizeof columns);
    }
    const Gaps gaps = find_gaps<true>(towards, ring[3] + view.spread, ~is_irregular,
                                      [&](std::size_t axis) UNSEEN_INLINE_LAMBDA { return words.slab(axis); });
    // An irregular ring is a silhouette from everywhere; what has no triangle with an area faces everything.
    const Floats &shown = view.is_inside_out ? gaps.back : gaps.front,
                 &hidden = view.is_inside_out ? gaps.front : gaps.back;
    const Ints is_empty = words.is_empty();
    return {~is_irregular & (is_empty | (shown > 0)), ~is_irregular & ~is_empty & (hidden > 0)};
}
