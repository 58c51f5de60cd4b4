// Brings memory nearer that is going to be read soon.
#pragma once

namespace unseen::vdtree {

inline void prefetch([[maybe_unused]] const void* what) noexcept {
#if defined(__GNUC__)
    __builtin_prefetch(what);
#endif
}

} // namespace unseen::vdtree
