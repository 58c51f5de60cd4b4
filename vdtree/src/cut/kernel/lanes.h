// Registers of floats and integers, a node a lane: what all of the kernel's arithmetic is written in.
//
// table.h and what it includes are for fold_kernel.cpp alone, which includes them once for each kind of register, in a
// namespace of its own, where `Vectors` is that kind (simd.h). So they have no guards.

using Floats = Vectors::Floats;
using Ints = Vectors::Ints;
constexpr std::size_t width = sizeof(Floats) / sizeof(float);

constexpr float pi = std::numbers::pi_v<float>;
constexpr float huge = 1e30f;

UNSEEN_INLINE Floats min_of(const Floats& a, const Floats& b) { return a < b ? a : b; }
UNSEEN_INLINE Floats max_of(const Floats& a, const Floats& b) { return a > b ? a : b; }
UNSEEN_INLINE Floats abs_of(const Floats& a) { return max_of(a, -a); }
UNSEEN_INLINE Floats all(float a) { return Floats{} + a; }

UNSEEN_INLINE float least_of(const Floats& values) { return Vectors::least_of(values); }

// A register of what the lanes have. (By way of an array, the processor would wait for its stores.)
template <class Register, class Of>
UNSEEN_INLINE Register collect(Of of) {
    if constexpr (width == 4) return Register{of(0), of(1), of(2), of(3)};
    else return Register{of(0), of(1), of(2), of(3), of(4), of(5), of(6), of(7)};
}

UNSEEN_INLINE Floats load(const float* from) {
    Floats v;
    std::memcpy(&v, from, sizeof v);
    return v;
}
UNSEEN_INLINE void store(float* to, const Floats& v) { std::memcpy(to, &v, sizeof v); }
UNSEEN_INLINE void store(std::int32_t* to, const Ints& v) { std::memcpy(to, &v, sizeof v); }
UNSEEN_INLINE Floats root_of(const Floats& square) { return Vectors::root_of(square); }

// The angle whose cosine is 1 - versine, up to a right one: Abramowitz and Stegun 4.4.46; error below 2e-8 radians but for
// the versine's own.
UNSEEN_INLINE Floats angle_of_versine(const Floats& versine) {
    const Floats x = 1 - versine;
    Floats series = all(-0.0012624911f);
    for (const float term :
         {0.0066700901f, -0.0170881256f, 0.0308918810f, -0.0501743046f, 0.0889789874f, -0.2145988016f, 1.5707963050f})
        series = series * x + term;
    return root_of(versine) * series;
}
UNSEEN_INLINE Floats angle_of_cosine(const Floats& cosine) {
    const Floats angle = angle_of_versine(1 - min_of(abs_of(cosine), all(1)));
    return cosine < 0 ? pi - angle : angle;
}

UNSEEN_INLINE Ints load(const std::int32_t* from) {
    Ints v;
    std::memcpy(&v, from, sizeof v);
    return v;
}

UNSEEN_INLINE Ints lane_bits() {
    Ints bits;
    std::int32_t values[width];
    for (std::size_t lane = 0; lane < width; ++lane) values[lane] = std::int32_t{1} << lane;
    std::memcpy(&bits, values, sizeof bits);
    return bits;
}
UNSEEN_INLINE std::uint32_t bits_of(const Ints& mask) { return Vectors::bits_of(mask); }
UNSEEN_INLINE bool any(const Ints& mask) { return bits_of(mask) != 0; }
UNSEEN_INLINE Ints mask_of(std::uint32_t bits, std::size_t first) {
    return ((Ints{} + static_cast<std::int32_t>(bits >> first)) & lane_bits()) != 0;
}
