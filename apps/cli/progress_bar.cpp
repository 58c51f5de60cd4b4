#include "progress_bar.h"

#include <algorithm>
#include <cstdio>

#include <unistd.h>

namespace unseen::app {
namespace {

constexpr std::chrono::milliseconds draw_interval{100};
constexpr int bar_characters = 30;
constexpr const char* erase_line = "\r\033[K";

} // namespace

ProgressBar::ProgressBar(std::string title)
    : title_(std::move(title)), is_shown_(isatty(STDERR_FILENO) == 1), next_draw_(std::chrono::steady_clock::now()) {}

ProgressBar::~ProgressBar() {
    if (is_drawn_) std::fputs(erase_line, stderr);
}

bool ProgressBar::operator()(double share_done, const char* stage) {
    const auto now = std::chrono::steady_clock::now();
    if (!is_shown_ || now < next_draw_) return true;
    next_draw_ = now + draw_interval;
    is_drawn_ = true;
    const double share = share_done > 0 ? std::min(share_done, 1.0) : 0; // 0 for NaN
    const int done = static_cast<int>(share * bar_characters);
    const std::string bar = std::string(static_cast<std::size_t>(done), '#') +
                            std::string(static_cast<std::size_t>(bar_characters - done), '.');
    std::fprintf(stderr, "%s%s [%s] %3d%% %s", erase_line, title_.c_str(), bar.c_str(), static_cast<int>(share * 100),
                 stage);
    std::fflush(stderr);
    return true;
}

} // namespace unseen::app
