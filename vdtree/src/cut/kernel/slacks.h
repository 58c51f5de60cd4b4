// Slacks: for how long verdicts hold. See Verdict in fold_tester.h.

// Slacks are shortened by these, so that rounding in a later test cannot change a verdict before its time. Shares of
// the distance to the eye: a dozen roundings of a float; the facing gap sums a few dozen products.
constexpr float position_rounding = 2e-6f;
constexpr float facing_rounding = 2e-5f;
static_assert(position_rounding <= test_rounding && facing_rounding <= test_rounding);

// With a gaze, a verdict holds while the distance and the eccentricity stay where it is right. An unfolded node (inward =
// 1) must stay within the distance of a farther bin, and this side of that bin's far edge. A folded one (-1) must stay
// beyond the distance of a nearer bin, and beyond that bin's near edge.
// The more bins are looked at, the more the node may turn, and the less the eye may move: the best of a few.
struct SlackQuery {
    Floats gap, inward, angle, radius, length, other_length;
    Ints row, other_row, bin;
};
struct GazeSlacks {
    Floats distance, turn;
};
UNSEEN_INLINE GazeSlacks gaze_slacks(const KernelView& view, const SlackQuery& of) {
    const Floats &gap = of.gap, &inward = of.inward;
    const Ints& bin = of.bin;
    const auto within = [&](const Ints& at) UNSEEN_INLINE_LAMBDA {
        return max_of(distances(view, of.row, at, of.length), distances(view, of.other_row, at, of.other_length));
    };
    const Ints outward_bins = __builtin_convertvector(inward, Ints); // reaches shrink away from the gaze
    const Floats degrees = all(1 / view.bins_per_radian);
    const Ints last = Ints{} + (view.bins - 1);
    // The sphere's half angle is bounded by the distances that the verdict holds for, so these may not differ by much.
    const Floats longest = gap > 0 ? 0.5f * gap : all(huge);
    const Floats nearest = of.radius * (1 / nearly_inside - 1);
    GazeSlacks best{all(0), all(-huge)};
    Floats best_score = all(0);
    for (std::int32_t step = 0;; step = step == 0 ? 1 : 2 * step) {
        Ints reached = bin + outward_bins * step;
        reached = reached < 0 ? Ints{} : reached;
        reached = reached > last ? last : reached;
        // The eye must not come nearly inside before it is asked again: there the eccentricity is 0.
        const Ints is_anywhere = ((inward > 0) & (reached == last)) | ((inward < 0) & (reached == 0));
        const Floats limit = within(reached);
        const Floats distance =
            min_of(((is_anywhere | (inward > 0) ? limit : max_of(limit, nearest)) - gap) * inward, longest);
        if (!any(distance > best_score)) break;
        const Floats sine = of.radius / max_of(gap + inward * distance + of.radius, all(least_length));
        // Not more than the half angle while it is to stay large, and not less while it is to stay small.
        const Floats half_angle = inward > 0 ? sine : sine + (pi / 2 - 1) * sine * sine * sine;
        const Ints edge = reached + (inward > 0 ? Ints{} + 1 : Ints{});
        Floats turn =
            (__builtin_convertvector(edge, Floats) * degrees - (of.angle - half_angle)) * inward - gaze_rounding;
        turn = is_anywhere ? all(huge) : turn;
        const Floats score = min_of(distance, turn * view.length_per_turn);
        const Ints is_better = score > best_score; // and holds now
        best_score = is_better ? score : best_score;
        best.distance = is_better ? distance : best.distance;
        best.turn = is_better ? turn : best.turn;
        if (step >= view.bins - 1) break;
    }
    return best;
}

struct Slacks {
    Floats position, gaze, facing, planes;
};
// What is outside is so by its height, or else by an occluder.
UNSEEN_INLINE Slacks slacks_of(const KernelView& view, const Nodes& of, const Measures& m, const Verdicts& v) {
    Floats left, turn = all(huge); // of the distance and the eccentricity
    if (view.has_gaze) {
        const GazeSlacks slacks =
            gaze_slacks(view, {m.gap, v.unfolded ? all(1) : all(-1), m.angle, of.radius, of.length,
                               v.by_silhouette ? of.silhouette_length : of.length, of.interior_row,
                               v.by_silhouette ? of.silhouette_row : of.interior_row, m.bin});
        left = slacks.distance, turn = slacks.turn;
    } else {
        const Floats reach = v.by_silhouette ? m.silhouette : m.interior;
        left = v.unfolded ? reach - m.gap : m.gap - reach;
    }
    const Ints is_outside = ~m.is_inside;
    const Floats inexact = (m.distance + of.radius) * position_rounding;
    const Floats position = (is_outside | v.away) ? all(huge) : max_of(left - inexact, all(0));
    const Floats gaze = (is_outside | v.away) ? all(huge) : turn;
    Floats facing = v.facing - m.distance * facing_rounding;
    facing = v.unfolded ? min_of(facing, m.uncovered - inexact) : facing;
    facing = is_outside ? (m.height < 0 ? all(huge) : -m.uncovered - inexact) : facing;
    const Ints is_below = is_outside & (m.height < 0);
    const Floats planes = v.unfolded ? m.height - inexact : is_below ? -m.height - inexact : all(huge);
    return {position, gaze, max_of(facing, all(0)), max_of(planes, all(0))};
}

UNSEEN_INLINE void store(const Slacks& slacks, TestBatch& tested, std::size_t first) {
    store(tested.position_slack + first, slacks.position);
    store(tested.gaze_slack + first, slacks.gaze);
    store(tested.facing_slack + first, slacks.facing);
    store(tested.plane_slack + first, slacks.planes);
    store(tested.light_slack + first, all(huge));
}
