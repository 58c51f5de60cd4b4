#include "progress_bar.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <unistd.h>

#include "terminal.h"

namespace unseen::app {
namespace {

constexpr std::chrono::milliseconds draw_interval{100};
constexpr int bar_characters = 30;
constexpr const char* erase_line = "\r\033[K";
constexpr std::chrono::seconds time_left_after{2}; // before, the pace is not known

std::string time_left(double share, std::chrono::steady_clock::duration elapsed) {
    if (elapsed < time_left_after || !(share > 0)) return {};
    const double seconds = std::chrono::duration<double>(elapsed).count() * (1 - share) / share;
    return ", " + duration(1000 * std::max(1.0, std::ceil(seconds))) + " left";
}

} // namespace

ProgressBar::ProgressBar(std::string title)
    : title_(printable(title)), is_shown_(isatty(STDERR_FILENO) == 1), start_(std::chrono::steady_clock::now()),
      next_draw_(start_) {}

ProgressBar::~ProgressBar() {
    if (is_drawn_) std::fputs(erase_line, stderr);
}

bool ProgressBar::operator()(double share_done, const char* stage) {
    const auto now = std::chrono::steady_clock::now();
    if (share_done < last_share_) start_ = now; // other work, at another pace
    last_share_ = share_done;
    if (!is_shown_ || now < next_draw_) return true;
    next_draw_ = now + draw_interval;
    is_drawn_ = true;
    const double share = share_done > 0 ? std::min(share_done, 1.0) : 0; // 0 for NaN
    const int done = static_cast<int>(share * bar_characters);
    const std::string bar = std::string(static_cast<std::size_t>(done), '#') +
                            std::string(static_cast<std::size_t>(bar_characters - done), '.');
    std::fprintf(stderr, "%s%s [%s] %3d%% %s%s", erase_line, title_.c_str(), bar.c_str(), static_cast<int>(share * 100),
                 stage, time_left(share, now - start_).c_str());
    std::fflush(stderr);
    return true;
}

} // namespace unseen::app
