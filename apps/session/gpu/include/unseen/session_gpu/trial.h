// Whether something that only saves time saves more than it costs: found out by trying, frame by frame.
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

namespace unseen::session {

struct TrialOptions {
    int frames = 12; // of a try; the first quarter does not count: something may have to be made first. 4 or more
    double hysteresis = 0.05;                    // the other way is taken where it is faster by more than this share
    int first_pause = 120, longest_pause = 3840; // frames between tries: twice as many after each that changes nothing
};

// Begins without it.
//
//     make_frame(trial.is_on());
//     trial.add(milliseconds);
class Trial {
public:
    explicit Trial(const TrialOptions& options = {}) : options_(options), pause_(options.first_pause) {}

    bool is_on() const noexcept { return chosen_ != is_trying_; } // how the next frame is to be made
    void add(double frame_ms);                                    // what that took; 0 or more

    bool is_chosen() const noexcept { return chosen_; }                  // apart from tries
    double milliseconds(bool on) const noexcept { return last_ms_[on]; } // of the median frame; NaN: not yet known
    int tries() const noexcept { return tries_; }

private:
    static constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
    void begin(bool tries);

    TrialOptions options_;
    bool chosen_ = false, is_trying_ = false;
    int pause_, frames_left_ = 0, tries_ = 0;
    std::vector<double> times_; // the last ones of this way
    double last_ms_[2] = {unknown, unknown};
};

} // namespace unseen::session
