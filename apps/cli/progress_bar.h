// A progress bar on stderr, for people only.
#pragma once

#include <chrono>
#include <string>

#include <unseen/vdtree/function_ref.h>

namespace unseen::app {

// A bar with the share that is done and, after two seconds, the time that the rest will take at this pace. Draws itself
// on stderr where that is a terminal, and is silent otherwise. Where the share falls, other work begins. Gone when it is destroyed. Hand it over as
// a Progress callback by std::ref(); it never cancels.
class ProgressBar {
public:
    explicit ProgressBar(std::string title);
    ProgressBar(const ProgressBar&) = delete;
    ProgressBar& operator=(const ProgressBar&) = delete;
    ~ProgressBar();

    bool operator()(double share_done, const char* stage);

private:
    std::string title_;
    bool is_shown_;
    bool is_drawn_ = false;
    double last_share_ = 0;
    std::chrono::steady_clock::time_point start_, next_draw_;
};

} // namespace unseen::app
