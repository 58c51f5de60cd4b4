#include "fold_kernel.h"

#include <cstring>
#include <numbers>

// GCC tells of an old change in how such vectors are passed; none is passed but inlined.
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wpsabi"
#endif

namespace unseen::vdtree {

namespace {

#define UNSEEN_INLINE __attribute__((always_inline)) inline
#define UNSEEN_INLINE_LAMBDA __attribute__((always_inline))

constexpr float pi = std::numbers::pi_v<float>;
constexpr float huge = 1e30f;
// With a gaze, a node is tested again after this share of its gap at the latest; see find_slacks().
constexpr float longest_path = 0.125f;
constexpr float shift_per_gap = 1.16f; // asin(x) / x / (1 - longest_path) for x up to longest_path / (1 - longest_path)
// Slacks are shortened by these, so that rounding in a later test cannot change a verdict before its time. Shares of the
// distance to the eye: a dozen roundings of a float; the facing gap sums a few dozen products.
constexpr float position_rounding = 2e-6f;
constexpr float facing_rounding = 2e-5f;
static_assert(position_rounding <= test_rounding && facing_rounding <= test_rounding);
// Radians: angles come from cosines in floats, which near 1 tell angles apart to about half of this.
constexpr float angle_rounding = 1e-3f;
constexpr float slab_units = 127;                    // of NormalSlabs in 1
constexpr float sqrt3 = 1.7320508075688772f;         // of the diagonals' coordinates
constexpr float widest_reach = 1.25f;                // of the parallelepipeds tried
// Rounding of the products and their sums, in shares of the distance: a dozen roundings of terms of a few times its size.
constexpr float rounding = 1e-5f;

// Vector registers of 4 and of 8 floats. (GCC 12 takes selections in registers of 16 apart.)
struct Four {
    using Floats = float __attribute__((vector_size(16)));
    using Ints = std::int32_t __attribute__((vector_size(16)));
};
struct Eight {
    using Floats = float __attribute__((vector_size(32)));
    using Ints = std::int32_t __attribute__((vector_size(32)));
};
// The arithmetic on one register's lanes at once.
template <class Vectors>
struct Lanes {
    using Floats = typename Vectors::Floats;
    using Ints = typename Vectors::Ints;
    static constexpr std::size_t width = sizeof(Floats) / sizeof(float);

    static UNSEEN_INLINE Floats min_of(const Floats& a, const Floats& b) { return a < b ? a : b; }
    static UNSEEN_INLINE Floats max_of(const Floats& a, const Floats& b) { return a > b ? a : b; }
    static UNSEEN_INLINE Floats abs_of(const Floats& a) { return max_of(a, -a); }
    static UNSEEN_INLINE Floats all(float a) { return Floats{} + a; }

    static UNSEEN_INLINE Floats load(const float* from) {
        Floats v;
        std::memcpy(&v, from, sizeof v);
        return v;
    }
    static UNSEEN_INLINE void store(float* to, const Floats& v) { std::memcpy(to, &v, sizeof v); }
    // Within two units in the last place: Newton's iterations from the classical guess. The processors' own are not to be had for
    // vectors of every width.
    static UNSEEN_INLINE Floats root_of(const Floats& square) {
        Floats inverse = reinterpret_cast<Floats>(0x5f3759df - (reinterpret_cast<Ints>(square) >> 1));
        const Floats half = square * 0.5f;
        for (int i = 0; i < 3; ++i) inverse = inverse * (1.5f - half * inverse * inverse);
        return square * inverse;
    }

    // Abramowitz and Stegun 4.4.46; error below 2e-8 radians but for the cosine's own.
    static UNSEEN_INLINE Floats angle_of_cosine(const Floats& cosine) {
        const Floats x = min_of(abs_of(cosine), all(1));
        Floats series = all(-0.0012624911f);
        for (const float term : {0.0066700901f, -0.0170881256f, 0.0308918810f, -0.0501743046f, 0.0889789874f, -0.2145988016f, 1.5707963050f})
            series = series * x + term;
        const Floats angle = root_of(1 - x) * series;
        return cosine < 0 ? pi - angle : angle;
    }

    static UNSEEN_INLINE Ints load(const std::int32_t* from) {
        Ints v;
        std::memcpy(&v, from, sizeof v);
        return v;
    }

    static UNSEEN_INLINE Ints lane_bits() {
        Ints bits;
        std::int32_t values[width];
        for (std::size_t lane = 0; lane < width; ++lane) values[lane] = std::int32_t{1} << lane;
        std::memcpy(&bits, values, sizeof bits);
        return bits;
    }
    // One bit a lane, the first lane's lowest.
    static UNSEEN_INLINE std::uint32_t bits_of(const Ints& mask) {
        const Ints bits = mask & lane_bits();
        std::int32_t lanes[width], sum = 0;
        std::memcpy(lanes, &bits, sizeof lanes);
        for (const std::int32_t lane : lanes) sum |= lane;
        return static_cast<std::uint32_t>(sum);
    }
    static UNSEEN_INLINE Ints mask_of(std::uint32_t bits, std::size_t first) {
        return ((Ints{} + static_cast<std::int32_t>(bits >> first)) & lane_bits()) != 0;
    }

    // The distances of rows at bins. Lookups go lane by lane.
    static UNSEEN_INLINE Floats distances(const KernelView& view, const Ints& rows, const Ints& bins, const Floats& lengths) {
        const Ints entries = rows * view.bins + bins;
        std::int32_t at[width];
        std::memcpy(at, &entries, sizeof at);
        float reach[width];
        for (std::size_t lane = 0; lane < width; ++lane) reach[lane] = view.reach[static_cast<std::size_t>(at[lane])];
        // A length of 0 times infinity is no number.
        return max_of(lengths, all(least_length)) * view.inverse_threshold * load(reach);
    }

    static UNSEEN_INLINE void measure(const KernelView& view, FoldBatch& batch, std::size_t first) {
        Floats e[3];
        for (int k = 0; k < 3; ++k) {
            e[k] = (view.eye_high[k] - load(batch.centre[k] + first)) + view.eye_low[k];
            store(batch.to_eye[k] + first, e[k]);
        }
        const Floats radius = load(batch.radius + first), length = load(batch.length + first);
        const Floats distance = root_of(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]);
        store(batch.distance + first, distance);
        store(batch.gap + first, distance - radius);
        Ints bin = {};
        if (view.has_gaze) {
            const Floats inverse = 1 / max_of(distance, all(least_length));
            const Floats towards = -(e[0] * view.gaze[0] + e[1] * view.gaze[1] + e[2] * view.gaze[2]) * inverse;
            const Floats half_angle = pi / 2 - angle_of_cosine(radius * inverse);
            Floats eccentricity = max_of(angle_of_cosine(towards) - half_angle, all(0));
            eccentricity = distance > radius ? eccentricity : all(0);
            store(batch.eccentricity + first, eccentricity);
            bin = __builtin_convertvector(min_of(eccentricity * view.bins_per_radian, all(static_cast<float>(view.bins - 1))), Ints);
        } else {
            store(batch.eccentricity + first, all(0));
        }
        std::memcpy(batch.bin + first, &bin, sizeof bin);
        const Floats gap = distance - radius;
        const Floats interior = distances(view, load(batch.interior_row + first), bin, length);
        const Floats silhouette =
            view.nobody ? interior
                        : max_of(interior, distances(view, load(batch.silhouette_row + first), bin, load(batch.silhouette_length + first)));
        store(batch.interior + first, interior);
        store(batch.silhouette + first, silhouette);

        Floats best = all(view.planes.empty() ? huge : -huge);
        for (std::size_t f = 0; f + 1 < view.first_plane.size(); ++f) {
            Floats lowest = all(huge);
            for (std::size_t p = view.first_plane[f]; p < view.first_plane[f + 1]; ++p) {
                const KernelView::Plane& plane = view.planes[p];
                lowest = min_of(lowest, plane.offset - (e[0] * plane.normal[0] + e[1] * plane.normal[1] + e[2] * plane.normal[2]));
            }
            best = max_of(best, lowest + radius);
        }
        store(batch.height + first, best);

        const Ints is_inside = best >= 0, is_near = gap < interior;
        Ints is_asked = is_inside & (view.everybody ? gap > 0 : gap < silhouette);
        if (!view.near_ones_too && !view.everybody) is_asked &= ~is_near;
        if (view.nobody) is_asked = Ints{};
        batch.is_inside |= bits_of(is_inside) << first;
        batch.is_near |= bits_of(is_near) << first;
        batch.is_asked |= bits_of(is_asked) << first;
    }
    static UNSEEN_INLINE void measure(const KernelView& view, FoldBatch& batch) {
        batch.is_inside = batch.is_near = batch.is_asked = 0;
        for (std::size_t first = 0; first < kernel_lanes; first += width) measure(view, batch, first);
    }

    static UNSEEN_INLINE bool any(const Ints& mask) {
        std::int32_t lanes[width], sum = 0;
        std::memcpy(lanes, &mask, sizeof lanes);
        for (const std::int32_t lane : lanes) sum |= lane;
        return sum != 0;
    }

    // The farther the bins that are looked at, the more the gaze may turn, and the less path is left: the best of a few.
    //
    // While the clock advances by `path`, the gaze turns by path * turn_per_length, and a point at least `gap` away shifts by
    // asin(step / rest) for each step, the rest of the gap being what longest_path leaves: less than shift_per_gap * path / gap
    // in all.
    static UNSEEN_INLINE void find_slacks(const KernelView& view, SlackBatch& batch, std::size_t first) {
        const Floats gap = load(batch.gap + first), inward = load(batch.inward + first), length = load(batch.length + first);
        const Floats eccentricity = load(batch.eccentricity + first);
        const Floats other_length = load(batch.silhouette_length + first);
        const Ints row = load(batch.row + first), other_row = load(batch.silhouette_row + first), bin = load(batch.bin + first);
        const auto within = [&](const Ints& at) UNSEEN_INLINE_LAMBDA {
            return max_of(distances(view, row, at, length), distances(view, other_row, at, other_length));
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
        best = (gap > 0) | (inward < 0) ? best : max_of(anywhere, all(0));
        store(batch.slack + first, best);
    }
    static UNSEEN_INLINE void find_slacks(const KernelView& view, SlackBatch& batch) {
        for (std::size_t first = 0; first < kernel_lanes; first += width) find_slacks(view, batch, first);
    }

    static UNSEEN_INLINE void finish_slacks(const KernelView& view, const FoldBatch& batch, Findings& findings, std::size_t first) {
        const Ints unfolded = mask_of(findings.unfolded, first), silhouettes = mask_of(findings.silhouettes, first);
        const Ints outside = ~mask_of(batch.is_inside, first), away = mask_of(findings.away, first);
        const Floats gap = load(batch.gap + first), distance = load(batch.distance + first), height = load(batch.height + first);
        const Floats inexact = (distance + load(batch.radius + first)) * position_rounding;
        Floats position;
        if (view.has_gaze) {
            position = load(findings.position_slack + first);
        } else {
            const Floats reach = silhouettes ? load(batch.silhouette + first) : load(batch.interior + first);
            position = unfolded ? reach - gap : gap - reach;
        }
        position = max_of(position - inexact, all(0));
        position = outside | away ? all(huge) : position;
        Floats facing = load(findings.facing_slack + first) - distance * facing_rounding;
        facing = unfolded ? min_of(facing, height - inexact) : facing;
        facing = outside ? -height - inexact : facing;
        store(findings.position_slack + first, position);
        store(findings.facing_slack + first, max_of(facing, all(0)));
    }
    static UNSEEN_INLINE void finish_slacks(const KernelView& view, const FoldBatch& batch, Findings& findings) {
        for (std::size_t first = 0; first < kernel_lanes; first += width) finish_slacks(view, batch, findings, first);
    }

    struct Interval {
        Floats lo, hi;
    };
    // Values of weight * slab.
    static UNSEEN_INLINE Interval scaled(const Interval& slab, const Floats& weight) {
        const Floats a = weight * slab.lo, b = weight * slab.hi;
        return {min_of(a, b), max_of(a, b)};
    }
    // Values of 1 or -1 times the slab.
    static UNSEEN_INLINE Interval turned(const Interval& slab, float sign) {
        return sign > 0 ? slab : Interval{-slab.hi, -slab.lo};
    }

    // The slabs of all lanes as floats.
    struct Slabs {
        static constexpr std::size_t count = NormalSlabs::axis_count * kernel_lanes;
        alignas(64) float lo[count];
        alignas(64) float hi[count];

        UNSEEN_INLINE explicit Slabs(const FacingBatch& batch) {
            // Sixteen rows of sixteen bytes, interleaved four times, are their columns.
            using Bytes = std::int8_t __attribute__((vector_size(16)));
            static_assert(kernel_lanes == 16);
            Bytes rows[16], mixed[16];
            std::memcpy(rows, batch.slabs, sizeof rows);
            for (int stage = 0; stage < 4; ++stage) {
                for (std::size_t i = 0; i < 8; ++i) {
                    mixed[2 * i] = __builtin_shuffle(rows[i], rows[i + 8], Bytes{0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23});
                    mixed[2 * i + 1] =
                        __builtin_shuffle(rows[i], rows[i + 8], Bytes{8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31});
                }
                std::memcpy(rows, mixed, sizeof rows);
            }
            std::int8_t bytes[2 * count];
            std::memcpy(bytes, rows, sizeof bytes);
            for (std::size_t i = 0; i < count; ++i) lo[i] = bytes[i];
            for (std::size_t i = 0; i < count; ++i) hi[i] = bytes[count + i];
        }
        UNSEEN_INLINE Interval operator()(std::size_t axis, std::size_t first) const {
            return {load(lo + axis * kernel_lanes + first), load(hi + axis * kernel_lanes + first)};
        }
    };

    // Keeps the best of the parallelepipeds: the largest minimum, and the smallest maximum.
    struct Best {
        Floats least, largest;
        UNSEEN_INLINE void offer(const Floats& low, const Floats& high, const Ints& usable) {
            least = usable ? max_of(least, low) : least;
            largest = usable ? min_of(largest, high) : largest;
        }
    };

    static UNSEEN_INLINE void run(const FacingBatch& batch, FacingGaps& gaps) {
        const Slabs slabs(batch);
        for (std::size_t first = 0; first < kernel_lanes; first += width) run(batch, slabs, gaps, first);
    }

    static UNSEEN_INLINE void run(const FacingBatch& batch, const Slabs& slabs, FacingGaps& gaps, std::size_t first) {
        const Floats e[3] = {load(batch.to_eye[0] + first), load(batch.to_eye[1] + first),
                             load(batch.to_eye[2] + first)};
        const Interval slab[3] = {slabs(0, first), slabs(1, first), slabs(2, first)};
        const Floats distance = abs_of(e[0]) + abs_of(e[1]) + abs_of(e[2]); // an upper bound
        const Floats limit = all(widest_reach * widest_reach * slab_units * slab_units);
        Floats squared[3];
        Interval along[3];
        for (int k = 0; k < 3; ++k) {
            const Floats reach = max_of(abs_of(slab[k].lo), abs_of(slab[k].hi));
            squared[k] = reach * reach;
            along[k] = scaled(slab[k], e[k]);
        }
        Best best{all(-1e30f), all(1e30f)};
        best.offer(along[0].lo + along[1].lo + along[2].lo, along[0].hi + along[1].hi + along[2].hi,
                   squared[0] + squared[1] + squared[2] <= limit);
        const Floats radius = load(batch.radius + first);
        const Floats needed = radius + distance * rounding;
        // Where the box alone proves everything, with much to spare, the rest would only add to that.
        constexpr float scale = 1 / (slab_units * widest_reach), plenty = 0.125f; // of the distance
        const Floats spare = needed + distance * plenty;
        if (!any(~((best.least * scale > spare) | (-best.largest * scale > spare)))) {
            store(gaps.front + first, best.least * scale - needed);
            store(gaps.back + first, -best.largest * scale - needed);
            return;
        }
        constexpr float signs[4][3] = {{1, 1, 1}, {-1, 1, 1}, {1, -1, 1}, {1, 1, -1}};
#pragma GCC unroll 4
        for (std::size_t d = 0; d < 4; ++d) {
            const Interval diagonal = slabs(3 + d, first);
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
                best.offer(a.lo + b.lo + c.lo, a.hi + b.hi + c.hi, reach * reach + squared[i] + squared[j] <= limit);
            }
        }
        const Floats front = best.least * scale - needed;
        const Floats back = -best.largest * scale - needed;
        store(gaps.front + first, front);
        store(gaps.back + first, back);
    }
};

#if defined(__x86_64__) && defined(__GNUC__)

[[gnu::target("avx2")]] void measure_avx2(const KernelView& view, FoldBatch& batch) { Lanes<Eight>::measure(view, batch); }
[[gnu::target("avx2")]] void find_slacks_avx2(const KernelView& view, SlackBatch& batch) { Lanes<Eight>::find_slacks(view, batch); }
[[gnu::target("avx2")]] void finish_slacks_avx2(const KernelView& view, const FoldBatch& batch, Findings& findings) {
    Lanes<Eight>::finish_slacks(view, batch, findings);
}
[[gnu::target("avx2")]] void facing_gaps_avx2(const FacingBatch& batch, FacingGaps& gaps) { Lanes<Eight>::run(batch, gaps); }
const bool has_avx2 = __builtin_cpu_supports("avx2");

#else

constexpr bool has_avx2 = false;
void measure_avx2(const KernelView&, FoldBatch&) {}
void find_slacks_avx2(const KernelView&, SlackBatch&) {}
void finish_slacks_avx2(const KernelView&, const FoldBatch&, Findings&) {}
void facing_gaps_avx2(const FacingBatch&, FacingGaps&) {}

#endif

} // namespace

// Neither has fused operations, so both give the same bits.
void measure(const KernelView& view, FoldBatch& batch) noexcept {
    if (has_avx2) measure_avx2(view, batch);
    else Lanes<Four>::measure(view, batch);
}

void find_slacks(const KernelView& view, SlackBatch& batch) noexcept {
    if (has_avx2) find_slacks_avx2(view, batch);
    else Lanes<Four>::find_slacks(view, batch);
}

void finish_slacks(const KernelView& view, const FoldBatch& batch, Findings& findings) noexcept {
    if (has_avx2) finish_slacks_avx2(view, batch, findings);
    else Lanes<Four>::finish_slacks(view, batch, findings);
}

void facing_gaps(const FacingBatch& batch, FacingGaps& gaps) noexcept {
    if (has_avx2) facing_gaps_avx2(batch, gaps);
    else Lanes<Four>::run(batch, gaps);
}

} // namespace unseen::vdtree
