// The one layer for SIMD, by the vectors that GCC and Clang share. There are two ways to use it.
// - Loops over arrays are left to the compiler: an UNSEEN_INLINE function is called by a plain one and by one marked
//   UNSEEN_AVX2; has_avx2() chooses between these.
// - Arithmetic on registers is written once, on `Vectors`, in headers that are included once for each kind of register:
//   see fold_kernel.cpp.
// Same bits on every processor: nothing is contracted to fused operations, square roots are rounded correctly, and there
// are no approximations. (Highway 1.0.3 took 1.2 to 1.5 times as long for distance tests of nodes anywhere in a tree.)
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

// Compilers tell of a change in how wide vectors are passed; none is passed but to functions that are inlined.
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wpsabi"
#endif

#define UNSEEN_INLINE __attribute__((always_inline)) inline
#define UNSEEN_INLINE_LAMBDA __attribute__((always_inline))

#if defined(__x86_64__) && defined(__GNUC__)
#define UNSEEN_AVX2 __attribute__((target("avx2")))
#else
#define UNSEEN_AVX2 // compiled like the plain one, and never called
#endif
// Registers of eight floats: GCC compiles whole regions for another processor.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define UNSEEN_EIGHT_WIDE
#endif

namespace unseen::vdtree {

inline bool has_avx2() noexcept {
#if defined(__x86_64__) && defined(__GNUC__)
    return __builtin_cpu_supports("avx2");
#else
    return false;
#endif
}

// Brings memory nearer that is going to be read soon. Always inlined: GCC leaves a call out, as one without an effect, if
// it comes from a function that is compiled for another processor.
UNSEEN_INLINE void prefetch([[maybe_unused]] const void* what) noexcept {
#if defined(__GNUC__)
    __builtin_prefetch(what);
#endif
}

using Float4 = float __attribute__((vector_size(16)));
using Float8 = float __attribute__((vector_size(32)));
using Double4 = double __attribute__((vector_size(32)));
using Int4 = std::int32_t __attribute__((vector_size(16)));
using Int8 = std::int32_t __attribute__((vector_size(32)));

// Rows of four floats become columns.
UNSEEN_INLINE void transpose(const Float4 (&rows)[4], Float4* columns) {
    const Float4 a = __builtin_shufflevector(rows[0], rows[1], 0, 4, 1, 5),
                 b = __builtin_shufflevector(rows[0], rows[1], 2, 6, 3, 7);
    const Float4 c = __builtin_shufflevector(rows[2], rows[3], 0, 4, 1, 5),
                 d = __builtin_shufflevector(rows[2], rows[3], 2, 6, 3, 7);
    columns[0] = __builtin_shufflevector(a, c, 0, 1, 4, 5), columns[1] = __builtin_shufflevector(a, c, 2, 3, 6, 7);
    columns[2] = __builtin_shufflevector(b, d, 0, 1, 4, 5), columns[3] = __builtin_shufflevector(b, d, 2, 3, 6, 7);
}

// The same of eight: each half of the registers as above.
UNSEEN_INLINE void transpose(const Float8 (&rows)[4], Float8* columns) {
    const Float8 a = __builtin_shufflevector(rows[0], rows[1], 0, 8, 1, 9, 4, 12, 5, 13);
    const Float8 b = __builtin_shufflevector(rows[0], rows[1], 2, 10, 3, 11, 6, 14, 7, 15);
    const Float8 c = __builtin_shufflevector(rows[2], rows[3], 0, 8, 1, 9, 4, 12, 5, 13);
    const Float8 d = __builtin_shufflevector(rows[2], rows[3], 2, 10, 3, 11, 6, 14, 7, 15);
    columns[0] = __builtin_shufflevector(a, c, 0, 1, 8, 9, 4, 5, 12, 13);
    columns[1] = __builtin_shufflevector(a, c, 2, 3, 10, 11, 6, 7, 14, 15);
    columns[2] = __builtin_shufflevector(b, d, 0, 1, 8, 9, 4, 5, 12, 13);
    columns[3] = __builtin_shufflevector(b, d, 2, 3, 10, 11, 6, 7, 14, 15);
}

// The four floats at at(lane) of each lane become four registers: of the lanes' first floats, and so on.
template <class At>
UNSEEN_INLINE void load_columns(At at, Float4* columns) {
    Float4 rows[4];
    for (std::size_t lane = 0; lane < 4; ++lane) std::memcpy(&rows[lane], at(lane), sizeof(Float4));
    transpose(rows, columns);
}
template <class At>
UNSEEN_INLINE void load_columns(At at, Float8* columns) {
    Float8 rows[4];
    for (std::size_t lane = 0; lane < 4; ++lane) {
        Float4 low, high;
        std::memcpy(&low, at(lane), sizeof low);
        std::memcpy(&high, at(lane + 4), sizeof high);
        rows[lane] = __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7);
    }
    transpose(rows, columns);
}

// Registers of one kind. Masks have all or no bits of a lane; bits_of() makes one bit a lane of them, the first lane's
// lowest.
struct FourWide {
    using Floats = Float4;
    using Ints = Int4;

    static UNSEEN_INLINE Floats root_of(const Floats& square) {
#if defined(UNSEEN_EIGHT_WIDE)
        return __builtin_ia32_sqrtps(square);
#else
        return {std::sqrt(square[0]), std::sqrt(square[1]), std::sqrt(square[2]), std::sqrt(square[3])};
#endif
    }
    static UNSEEN_INLINE std::uint32_t bits_of(const Ints& mask) {
#if defined(UNSEEN_EIGHT_WIDE)
        return static_cast<std::uint32_t>(__builtin_ia32_movmskps(reinterpret_cast<Floats>(mask)));
#else
        return static_cast<std::uint32_t>((mask[0] & 1) | (mask[1] & 2) | (mask[2] & 4) | (mask[3] & 8));
#endif
    }
    static UNSEEN_INLINE float least_of(Floats values) {
        const Floats half = __builtin_shufflevector(values, values, 2, 3, 0, 1);
        values = values < half ? values : half;
        return std::min(values[0], values[1]);
    }
    template <class At>
    static UNSEEN_INLINE void load_columns(At at, Floats* columns) {
        vdtree::load_columns(at, columns);
    }
};

#if defined(UNSEEN_EIGHT_WIDE)
#pragma GCC push_options
#pragma GCC target("avx2")
struct EightWide {
    using Floats = Float8;
    using Ints = Int8;

    static UNSEEN_INLINE Floats root_of(const Floats& square) { return __builtin_ia32_sqrtps256(square); }
    static UNSEEN_INLINE std::uint32_t bits_of(const Ints& mask) {
        return static_cast<std::uint32_t>(__builtin_ia32_movmskps256(reinterpret_cast<Floats>(mask)));
    }
    static UNSEEN_INLINE float least_of(const Floats& values) {
        const auto low = __builtin_shufflevector(values, values, 0, 1, 2, 3),
                   high = __builtin_shufflevector(values, values, 4, 5, 6, 7);
        return FourWide::least_of(low < high ? low : high);
    }
    // As above, but that `at` is for these processors, too.
    template <class At>
    static UNSEEN_INLINE void load_columns(At at, Floats* columns) {
        Floats rows[4];
        for (std::size_t lane = 0; lane < 4; ++lane) {
            Float4 low, high;
            std::memcpy(&low, at(lane), sizeof low);
            std::memcpy(&high, at(lane + 4), sizeof high);
            rows[lane] = __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7);
        }
        transpose(rows, columns);
    }
};
#pragma GCC pop_options
#endif

} // namespace unseen::vdtree
