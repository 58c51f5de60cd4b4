#include <unseen/session_gpu/trial.h>

#include <algorithm>

#include "median.h"

namespace unseen::session {
void Trial::begin(bool tries) {
    is_trying_ = tries;
    tries_ += tries;
    times_.clear();
    frames_left_ = tries ? options_.frames : pause_;
}

void Trial::add(double frame_ms) {
    if (tries_ == 0 && times_.empty()) frames_left_ = options_.frames; // the first try comes soon
    times_.push_back(frame_ms);
    const auto counting = static_cast<std::size_t>(std::max(options_.frames - options_.frames / 4, 1));
    if (times_.size() > counting) times_.erase(times_.begin()); // the first ones do not count
    if (--frames_left_ > 0) return;
    last_ms_[is_on()] = median(times_);
    if (!is_trying_) return begin(true);
    const bool is_faster = last_ms_[!chosen_] < last_ms_[chosen_] * (1 - options_.hysteresis);
    if (is_faster) chosen_ = !chosen_;
    pause_ = is_faster || tries_ == 1 ? options_.first_pause : std::min(2 * pause_, options_.longest_pause);
    begin(false);
}

} // namespace unseen::session
