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

constexpr float pi = std::numbers::pi_v<float>;
constexpr float huge = 1e30f;
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

    static UNSEEN_INLINE void measure(const KernelView& view, SphereBatch& batch, std::size_t first) {
        Floats e[3];
        for (int k = 0; k < 3; ++k) {
            e[k] = (view.eye_high[k] - load(batch.centre[k] + first)) + view.eye_low[k];
            store(batch.to_eye[k] + first, e[k]);
        }
        const Floats radius = load(batch.radius + first);
        const Floats distance = root_of(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]);
        store(batch.distance + first, distance);
        store(batch.gap + first, distance - radius);
        Floats eccentricity = all(0);
        if (view.has_gaze) {
            const Floats inverse = 1 / distance;
            const Floats towards = -(e[0] * view.gaze[0] + e[1] * view.gaze[1] + e[2] * view.gaze[2]) * inverse;
            const Floats half_angle = pi / 2 - angle_of_cosine(radius * inverse);
            eccentricity = max_of(angle_of_cosine(towards) - half_angle, all(0));
            eccentricity = distance > radius ? eccentricity : all(0);
        }
        store(batch.eccentricity + first, eccentricity);
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
    }
    static UNSEEN_INLINE void measure(const KernelView& view, SphereBatch& batch) {
        for (std::size_t first = 0; first < kernel_lanes; first += width) measure(view, batch, first);
    }

    struct Interval {
        Floats lo, hi;
    };
    // Values of weight * slab.
    static UNSEEN_INLINE Interval scaled(const Interval& slab, const Floats& weight) {
        const Floats a = weight * slab.lo, b = weight * slab.hi;
        return {min_of(a, b), max_of(a, b)};
    }
    // The slabs of all lanes as floats.
    struct Slabs {
        static constexpr std::size_t count = NormalSlabs::axis_count * kernel_lanes;
        alignas(64) float lo[count];
        alignas(64) float hi[count];

        UNSEEN_INLINE explicit Slabs(const FacingBatch& batch) {
            for (std::size_t i = 0; i < count; ++i) lo[i] = batch.lo[i];
            for (std::size_t i = 0; i < count; ++i) hi[i] = batch.hi[i];
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
        constexpr float signs[4][3] = {{1, 1, 1}, {-1, 1, 1}, {1, -1, 1}, {1, 1, -1}};
        for (std::size_t d = 0; d < 4; ++d) {
            const Interval diagonal = slabs(3 + d, first);
            for (int k = 0; k < 3; ++k) {
                // The diagonal in place of axis k: e = weight * diagonal + rest along i and j.
                const int i = (k + 1) % 3, j = (k + 2) % 3;
                const float sk = signs[d][k], si = signs[d][i], sj = signs[d][j];
                const Floats weight = e[k] * sk;
                const Interval a = scaled(diagonal, weight * sqrt3), b = scaled(slab[i], e[i] - weight * si),
                               c = scaled(slab[j], e[j] - weight * sj);
                // The replaced coordinate, sk * (sqrt3 * diagonal - si * x_i - sj * x_j), is in this interval.
                const Interval bi = scaled(slab[i], all(si)), bj = scaled(slab[j], all(sj));
                const Floats high = diagonal.hi * sqrt3 - bi.lo - bj.lo, low = diagonal.lo * sqrt3 - bi.hi - bj.hi;
                const Floats reach = max_of(abs_of(low), abs_of(high));
                best.offer(a.lo + b.lo + c.lo, a.hi + b.hi + c.hi, reach * reach + squared[i] + squared[j] <= limit);
            }
        }
        const Floats radius = load(batch.radius + first);
        const Floats needed = radius + distance * rounding;
        const Floats front = best.least * (1 / (slab_units * widest_reach)) - needed;
        const Floats back = -best.largest * (1 / (slab_units * widest_reach)) - needed;
        store(gaps.front + first, front);
        store(gaps.back + first, back);
    }
};

#if defined(__x86_64__) && defined(__GNUC__)

[[gnu::target("avx2")]] void measure_avx2(const KernelView& view, SphereBatch& batch) { Lanes<Eight>::measure(view, batch); }
[[gnu::target("avx2")]] void facing_gaps_avx2(const FacingBatch& batch, FacingGaps& gaps) { Lanes<Eight>::run(batch, gaps); }
const bool has_avx2 = __builtin_cpu_supports("avx2");

#else

constexpr bool has_avx2 = false;
void measure_avx2(const KernelView&, SphereBatch&) {}
void facing_gaps_avx2(const FacingBatch&, FacingGaps&) {}

#endif

} // namespace

// Neither has fused operations, so both give the same bits.
void measure(const KernelView& view, SphereBatch& batch) noexcept {
    if (has_avx2) measure_avx2(view, batch);
    else Lanes<Four>::measure(view, batch);
}

void facing_gaps(const FacingBatch& batch, FacingGaps& gaps) noexcept {
    if (has_avx2) facing_gaps_avx2(batch, gaps);
    else Lanes<Four>::run(batch, gaps);
}

} // namespace unseen::vdtree
