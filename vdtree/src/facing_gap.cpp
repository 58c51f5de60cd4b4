#include "facing_gap.h"

#include <cstring>

// GCC tells of an old change in how such vectors are passed; none is passed but inlined.
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wpsabi"
#endif

namespace unseen::vdtree {

namespace {

#define UNSEEN_INLINE __attribute__((always_inline)) inline

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

    template <class Vector, class T>
    static UNSEEN_INLINE Vector load(const T* from) {
        Vector v;
        std::memcpy(&v, from, sizeof v);
        return v;
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
        static constexpr std::size_t count = NormalSlabs::axis_count * facing_lanes;
        alignas(64) float lo[count];
        alignas(64) float hi[count];

        UNSEEN_INLINE explicit Slabs(const FacingBatch& batch) {
            for (std::size_t i = 0; i < count; ++i) lo[i] = batch.lo[i];
            for (std::size_t i = 0; i < count; ++i) hi[i] = batch.hi[i];
        }
        UNSEEN_INLINE Interval operator()(std::size_t axis, std::size_t first) const {
            return {load<Floats>(lo + axis * facing_lanes + first), load<Floats>(hi + axis * facing_lanes + first)};
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
        for (std::size_t first = 0; first < facing_lanes; first += width) run(batch, slabs, gaps, first);
    }

    static UNSEEN_INLINE void run(const FacingBatch& batch, const Slabs& slabs, FacingGaps& gaps, std::size_t first) {
        const Floats e[3] = {load<Floats>(batch.to_eye[0] + first), load<Floats>(batch.to_eye[1] + first),
                             load<Floats>(batch.to_eye[2] + first)};
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
        const Floats radius = load<Floats>(batch.radius + first);
        const Floats needed = radius + distance * rounding;
        const Floats front = best.least * (1 / (slab_units * widest_reach)) - needed;
        const Floats back = -best.largest * (1 / (slab_units * widest_reach)) - needed;
        std::memcpy(gaps.front + first, &front, sizeof front);
        std::memcpy(gaps.back + first, &back, sizeof back);
    }
};

#if defined(__x86_64__) && defined(__GNUC__)

[[gnu::target("avx2")]] void with_avx2(const FacingBatch& batch, FacingGaps& gaps) { Lanes<Eight>::run(batch, gaps); }
void with_sse2(const FacingBatch& batch, FacingGaps& gaps) { Lanes<Four>::run(batch, gaps); }

auto choose() {
    return __builtin_cpu_supports("avx2") ? with_avx2 : with_sse2;
}

#else

auto choose() {
    return +[](const FacingBatch& batch, FacingGaps& gaps) { Lanes<Four>::run(batch, gaps); };
}

#endif

} // namespace

// No target includes fused operations, and contraction is off, so all of them give the same bits.
void facing_gaps(const FacingBatch& batch, FacingGaps& gaps) noexcept {
    static const auto chosen = choose();
    chosen(batch, gaps);
}

} // namespace unseen::vdtree
