// Brings memory nearer that is going to be read soon.
#pragma once

#include <unseen/vdtree/internal/simd.h>

namespace unseen::vdtree {

// Always inlined: GCC takes a call of it for one without an effect, and leaves it out, where it comes from a function
// compiled for another processor.
UNSEEN_INLINE void prefetch([[maybe_unused]] const void* what) noexcept {
#if defined(__GNUC__)
    __builtin_prefetch(what);
#endif
}

} // namespace unseen::vdtree
