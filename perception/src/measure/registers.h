// Loops over cells, samples and points that are written once, for registers of whatever width.
#pragma once

#include <cstddef>
#include <cstring>

#include <unseen/vdtree/internal/simd.h>

namespace unseen::perception {

template <class Floats>
inline constexpr std::size_t width_of = sizeof(Floats) / sizeof(float);

template <class Floats>
UNSEEN_INLINE Floats floats_at(const float* from) {
    Floats to;
    std::memcpy(&to, from, sizeof to);
    return to;
}
template <class Floats>
UNSEEN_INLINE void store(const Floats& values, float* to) {
    std::memcpy(to, &values, sizeof values);
}

template <class F>
void on_four_wide(const F& f) {
    f.template operator()<vdtree::Float4>();
}
#if defined(UNSEEN_EIGHT_WIDE)
template <class F>
UNSEEN_AVX2 void on_eight_wide(const F& f) {
    f.template operator()<vdtree::Float8>();
}
#endif
// Calls f<Floats>() with the widest registers of this processor. `f`: UNSEEN_INLINE_LAMBDA.
template <class F>
void on_widest(const F& f) {
#if defined(UNSEEN_EIGHT_WIDE)
    if (vdtree::has_avx2()) return on_eight_wide(f);
#endif
    on_four_wide(f);
}

} // namespace unseen::perception
