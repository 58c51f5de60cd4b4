// Slacks: for how long verdicts hold. See Verdict in fold_tester.h.

// With a gaze, a node is tested again after this share of its gap at the latest; see position_slack().
constexpr float longest_path = 0.125f;
constexpr float shift_per_gap = 1.16f; // asin(x) / x / (1 - longest_path) for x up to longest_path / (1 - longest_path)
// Slacks are shortened by these, so that rounding in a later test cannot change a verdict before its time. Shares of
// the distance to the eye: a dozen roundings of a float; the facing gap sums a few dozen products.
constexpr float position_rounding = 2e-6f;
constexpr float facing_rounding = 2e-5f;
static_assert(position_rounding <= test_rounding && facing_rounding <= test_rounding);
// Radians: angles come from cosines in floats, which near 1 tell angles apart to about half of this.
constexpr float angle_rounding = 1e-3f;

// With a gaze, the node has to stay within (inward = 1), or beyond (-1), the distances of all bins of eccentricity that it
// may come to. The farther the bins that are looked at, the more the gaze may turn, and the less path is left: the best
// of a few.
//
// While the clock advances by `path`, the gaze turns by path * turn_per_length, and a point at least `gap` away shifts
// by asin(step / rest) for each step, the rest of the gap being what longest_path leaves: less than shift_per_gap *
// path / gap in all.
struct SlackQuery {
    Floats gap, inward, eccentricity, length, other_length;
    Ints row, other_row, bin;
};
UNSEEN_INLINE Floats gaze_slack(const KernelView& view, const SlackQuery& of) {
    const Floats &gap = of.gap, &inward = of.inward, &eccentricity = of.eccentricity;
    const Ints& bin = of.bin;
    const auto within = [&](const Ints& at) UNSEEN_INLINE_LAMBDA {
        return max_of(distances(view, of.row, at, of.length), distances(view, of.other_row, at, of.other_length));
    };
    const Ints outward_bins = __builtin_convertvector(inward, Ints); // reaches shrink away from the gaze
    const Floats degrees = all(1 / view.bins_per_radian);
    const Floats turn_of_path = view.turn_per_length + shift_per_gap / max_of(gap, all(least_length));
    const Ints last = Ints{} + (view.bins - 1);
    Floats best = {};
    for (std::int32_t step = 0; step < view.bins; step = step == 0 ? 1 : 2 * step) {
        Ints reached = bin + outward_bins * step;
        reached = reached < 0 ? Ints{} : reached;
        reached = reached > last ? last : reached;
        const Floats there = (within(reached) - gap) * inward;
        // Up to the far edge of the bin that was looked at; none beyond the last.
        const Ints edge = reached + (inward > 0 ? Ints{} + 1 : Ints{});
        Floats turn = (__builtin_convertvector(edge, Floats) * degrees - eccentricity) * inward;
        turn = ((inward > 0) & (reached == last)) | ((inward < 0) & (reached == 0)) ? all(huge) : turn;
        const Floats path = min_of((turn - angle_rounding) / turn_of_path, longest_path * gap);
        best = max_of(best, min_of(there, path));
        if (!any(there > best)) break;
    }
    // From inside, or nearly, the eccentricity may be anything soon.
    const Floats anywhere = (within(last) - gap) * inward;
    return ((gap > 0) | (inward < 0)) ? best : max_of(anywhere, all(0));
}

struct Slacks {
    Floats position, facing, planes;
};
// What is outside is so by its height, or else by an occluder.
UNSEEN_INLINE Slacks slacks_of(const KernelView& view, const Nodes& of, const Measures& m, const Verdicts& v) {
    Floats left; // of the distance
    if (view.has_gaze) {
        left = gaze_slack(view, {m.gap, v.unfolded ? all(1) : all(-1), m.eccentricity, of.length,
                                 v.by_silhouette ? of.silhouette_length : of.length, of.interior_row,
                                 v.by_silhouette ? of.silhouette_row : of.interior_row, m.bin});
    } else {
        const Floats reach = v.by_silhouette ? m.silhouette : m.interior;
        left = v.unfolded ? reach - m.gap : m.gap - reach;
    }
    const Ints is_outside = ~m.is_inside;
    const Floats inexact = (m.distance + of.radius) * position_rounding;
    const Floats position = (is_outside | v.away) ? all(huge) : max_of(left - inexact, all(0));
    Floats facing = v.facing - m.distance * facing_rounding;
    facing = v.unfolded ? min_of(facing, m.uncovered - inexact) : facing;
    facing = is_outside ? (m.height < 0 ? all(huge) : -m.uncovered - inexact) : facing;
    const Ints is_below = is_outside & (m.height < 0);
    const Floats planes = v.unfolded ? m.height - inexact : is_below ? -m.height - inexact : all(huge);
    return {position, max_of(facing, all(0)), max_of(planes, all(0))};
}

UNSEEN_INLINE void store(const Slacks& slacks, TestBatch& tested, std::size_t first) {
    store(tested.position_slack + first, slacks.position);
    store(tested.facing_slack + first, slacks.facing);
    store(tested.plane_slack + first, slacks.planes);
    store(tested.light_slack + first, all(huge));
}
