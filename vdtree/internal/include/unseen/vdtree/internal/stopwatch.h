// How much time has passed since a moment.
#pragma once

#include <chrono>

namespace unseen::vdtree {

using Clock = std::chrono::steady_clock;

inline double seconds_since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}
inline double ms_since(Clock::time_point start) { return 1e3 * seconds_since(start); }

} // namespace unseen::vdtree
