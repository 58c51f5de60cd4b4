#include "cut/kernel/fold_kernel.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <numbers>

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define UNSEEN_WIDE_KERNELS
#include <immintrin.h>
#endif

#include "cut/kernel/prefetch.h"

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
// 1 / sqrt(s) from below, for squares s of lengths in units of slabs: tangents at 1.2 and 2, and what it is at the longest vector that any
// parallelepiped holds: a diagonal's replaced coordinate of up to sqrt(3) + 2, and two of 1.
struct Tangent {
    float at_0, slope;
};
constexpr Tangent tangent_of(double root) {             // at the square of `root`
    constexpr double units = 127, just_less = 1 - 1e-6; // covers the rounding of the products
    return {static_cast<float>(1.5 / (root * units) * just_less),
            static_cast<float>(0.5 / (root * root * root * units * units * units))};
}
constexpr Tangent near_tangent = tangent_of(1.0954), middle_tangent = tangent_of(1.4142);
constexpr float least_inverse_reach = 0.25f / slab_units;
// A node counts as hidden where a sphere of so many radii of its ring is: triangles that it shares with neighbours reach beyond the ring
// where these are folded, too, by no more than their own size.
constexpr float occluded_radii = 2;
// Rounding of the products and their sums, in shares of the distance: a dozen roundings of terms of a few times its size.
constexpr float rounding = 1e-5f;

UNSEEN_INLINE void prefetch_node(const NodeArrays& arrays, NodeId node) {
    prefetch(arrays.bounds + node);
    if (arrays.support) prefetch(arrays.support + node);
    if (arrays.classes) prefetch(arrays.classes + node);
    if (arrays.facing) prefetch(arrays.facing + node);
    if (arrays.lengths) prefetch(arrays.lengths + node);
    if (arrays.silhouette_lengths) prefetch(arrays.silhouette_lengths + node);
}

// Vector registers of 4 and of 8 floats. (With 16, tests from the cache take four fifths of the time, but frames and jumps take as long.)
// Masks have all or no bits of a lane; bits_of() makes one bit a lane of them, the first lane's lowest. Square roots are rounded correctly.
namespace four_wide {

struct Vectors {
    using Floats = float __attribute__((vector_size(16)));
    using Ints = std::int32_t __attribute__((vector_size(16)));

#if defined(UNSEEN_WIDE_KERNELS)
    static UNSEEN_INLINE Floats root_of(const Floats& square) { return __builtin_ia32_sqrtps(square); }
    static UNSEEN_INLINE std::uint32_t bits_of(const Ints& mask) {
        return static_cast<std::uint32_t>(__builtin_ia32_movmskps(reinterpret_cast<Floats>(mask)));
    }
#else
    static UNSEEN_INLINE Floats root_of(const Floats& square) {
        return {std::sqrt(square[0]), std::sqrt(square[1]), std::sqrt(square[2]), std::sqrt(square[3])};
    }
    static UNSEEN_INLINE std::uint32_t bits_of(const Ints& mask) {
        return static_cast<std::uint32_t>((mask[0] & 1) | (mask[1] & 2) | (mask[2] & 4) | (mask[3] & 8));
    }
#endif

    static UNSEEN_INLINE float least_of(Floats values) {
        const Floats half = __builtin_shufflevector(values, values, 2, 3, 0, 1);
        values = values < half ? values : half;
        return std::min(values[0], values[1]);
    }

    // Four floats of each lane's record become four registers, one of each record's first floats, and so on.
    template <class At>
    static UNSEEN_INLINE void load_columns(At at, Floats* columns) {
        Floats rows[4];
        for (std::size_t lane = 0; lane < 4; ++lane) std::memcpy(&rows[lane], at(lane), sizeof(Floats));
        const Floats a = __builtin_shufflevector(rows[0], rows[1], 0, 4, 1, 5), b = __builtin_shufflevector(rows[0], rows[1], 2, 6, 3, 7);
        const Floats c = __builtin_shufflevector(rows[2], rows[3], 0, 4, 1, 5), d = __builtin_shufflevector(rows[2], rows[3], 2, 6, 3, 7);
        columns[0] = __builtin_shufflevector(a, c, 0, 1, 4, 5), columns[1] = __builtin_shufflevector(a, c, 2, 3, 6, 7);
        columns[2] = __builtin_shufflevector(b, d, 0, 1, 4, 5), columns[3] = __builtin_shufflevector(b, d, 2, 3, 6, 7);
    }
};

#include "cut/kernel/fold_lanes.h"

} // namespace four_wide

#if defined(UNSEEN_WIDE_KERNELS)

#pragma GCC push_options
#pragma GCC target("avx2")
namespace eight_wide {

struct Vectors {
    using Floats = float __attribute__((vector_size(32)));
    using Ints = std::int32_t __attribute__((vector_size(32)));

    static UNSEEN_INLINE Floats root_of(const Floats& square) { return __builtin_ia32_sqrtps256(square); }
    static UNSEEN_INLINE std::uint32_t bits_of(const Ints& mask) {
        return static_cast<std::uint32_t>(__builtin_ia32_movmskps256(reinterpret_cast<Floats>(mask)));
    }

    static UNSEEN_INLINE float least_of(const Floats& values) {
        const auto low = __builtin_shufflevector(values, values, 0, 1, 2, 3), high = __builtin_shufflevector(values, values, 4, 5, 6, 7);
        return four_wide::Vectors::least_of(low < high ? low : high);
    }

    template <class At>
    static UNSEEN_INLINE void load_columns(At at, Floats* columns) {
        Floats rows[4];
        for (std::size_t lane = 0; lane < 4; ++lane) {
            four_wide::Vectors::Floats low, high;
            std::memcpy(&low, at(lane), sizeof low);
            std::memcpy(&high, at(lane + 4), sizeof high);
            rows[lane] = __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7);
        }
        const Floats a = __builtin_shufflevector(rows[0], rows[1], 0, 8, 1, 9, 4, 12, 5, 13);
        const Floats b = __builtin_shufflevector(rows[0], rows[1], 2, 10, 3, 11, 6, 14, 7, 15);
        const Floats c = __builtin_shufflevector(rows[2], rows[3], 0, 8, 1, 9, 4, 12, 5, 13);
        const Floats d = __builtin_shufflevector(rows[2], rows[3], 2, 10, 3, 11, 6, 14, 7, 15);
        columns[0] = __builtin_shufflevector(a, c, 0, 1, 8, 9, 4, 5, 12, 13);
        columns[1] = __builtin_shufflevector(a, c, 2, 3, 10, 11, 6, 7, 14, 15);
        columns[2] = __builtin_shufflevector(b, d, 0, 1, 8, 9, 4, 5, 12, 13);
        columns[3] = __builtin_shufflevector(b, d, 2, 3, 10, 11, 6, 7, 14, 15);
    }
};

#include "cut/kernel/fold_lanes.h"

} // namespace eight_wide
#pragma GCC pop_options

#endif

// All of one kind.
struct Kernel {
    decltype(&vdtree::measure) measure;
    decltype(&vdtree::find_slacks) find_slacks;
    decltype(&vdtree::finish_slacks) finish_slacks;
    decltype(&vdtree::facing_gaps) facing_gaps;
    decltype(&vdtree::test) test;
    decltype(&vdtree::decide) decide;
    decltype(&vdtree::decide_range) decide_range;
    decltype(&vdtree::find_costs) find_costs;
    decltype(&vdtree::find_cost_bounds) find_cost_bounds;
    decltype(&vdtree::move_blocks) move_blocks;
    decltype(&vdtree::keep_inside) keep_inside;
    decltype(&vdtree::look_at_blocks) look_at_blocks;
    decltype(&vdtree::find_dues) find_dues;
    decltype(&vdtree::find_due) find_due;
};

template <class Of>
constexpr Kernel kernel_of() {
    return {Of::measure,     Of::find_slacks,    Of::finish_slacks, Of::facing_gaps,      Of::test,
            Of::decide,      Of::decide_range,   Of::find_costs,    Of::find_cost_bounds, Of::move_blocks,
            Of::keep_inside, Of::look_at_blocks, Of::find_dues,     Of::find_due};
}

Kernel best_kernel() {
#if defined(UNSEEN_WIDE_KERNELS)
    if (__builtin_cpu_supports("avx2")) return kernel_of<eight_wide::Kernels>();
#endif
    return kernel_of<four_wide::Kernels>();
}
const Kernel kernel = best_kernel();

} // namespace

// None has fused operations, so all give the same verdicts.
void measure(const KernelView& view, FoldBatch& batch) noexcept { kernel.measure(view, batch); }

void find_slacks(const KernelView& view, SlackBatch& batch) noexcept { kernel.find_slacks(view, batch); }

void finish_slacks(const KernelView& view, const FoldBatch& batch, Findings& findings) noexcept { kernel.finish_slacks(view, batch, findings); }

void facing_gaps(const FacingBatch& batch, FacingGaps& gaps) noexcept { kernel.facing_gaps(batch, gaps); }

void test(const KernelView& view, std::span<const FoldCandidate* const> lanes, TestBatch& tested) noexcept { kernel.test(view, lanes, tested); }

void decide(const KernelView& view, const NodeArrays& arrays, std::span<const NodeId> nodes, std::uint64_t* unfolded) noexcept {
    kernel.decide(view, arrays, nodes, unfolded);
}

void find_costs(const KernelView& view, const NodeArrays& arrays, const CostTables& tables, std::span<const NodeId> nodes,
                const NodeCosts& costs) noexcept {
    kernel.find_costs(view, arrays, tables, nodes, costs);
}

void find_cost_bounds(const KernelView& view, const NodeArrays& arrays, const CostTables& tables, std::span<const NodeId> nodes,
                      float no_outline_over, float* cost, float* seen_cost) noexcept {
    kernel.find_cost_bounds(view, arrays, tables, nodes, no_outline_over, cost, seen_cost);
}

void decide_range(const KernelView& view, const NodeArrays& arrays, NodeId first, std::size_t count, std::uint64_t* unfolded) noexcept {
    kernel.decide_range(view, arrays, first, count, unfolded);
}

void move_blocks(const float (&eye_high)[3], const float (&eye_low)[3], float path, BlockSpheres& spheres) noexcept {
    kernel.move_blocks(eye_high, eye_low, path, spheres);
}

void keep_inside(const KernelView& view, float hair, const KernelClock& clock, const BlockSpheres& spheres,
                 float* deadlines) noexcept {
    kernel.keep_inside(view, hair, clock, spheres, deadlines);
}

std::size_t look_at_blocks(std::span<const std::uint32_t> which, float position_clock, float facing_clock, const BlockDues* dues,
                           const std::uint16_t* unfolded, const BlockSpheres& spheres, BlockDeadlines& deadlines, std::uint32_t* due) noexcept {
    return kernel.look_at_blocks(which, position_clock, facing_clock, dues, unfolded, spheres, deadlines, due);
}

void find_dues(const TestBatch& tested, DueBatch& dues) noexcept { kernel.find_dues(tested, dues); }

void find_due(float position_clock, float facing_clock, const BlockSpheres& spheres, const BlockDeadlines& deadlines,
              std::uint64_t* due) noexcept {
    kernel.find_due(position_clock, facing_clock, spheres, deadlines, due);
}

} // namespace unseen::vdtree
