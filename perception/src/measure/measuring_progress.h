// Tells the caller of a measurement, which many threads work on in several steps, how far it is.
#pragma once

#include <algorithm>
#include <atomic>
#include <thread>

#include <unseen/vdtree/function_ref.h>

namespace unseen::perception {

// Calls the caller's callback on the caller's own thread only, and tells everybody whether to stop.
class MeasuringProgress {
public:
    // Keeps a reference to the callback; an empty one never stops.
    explicit MeasuringProgress(const Progress& progress) : progress_(progress) {}

    // The next step goes up to that share of the whole, and has so many pieces, in any unit. On the caller's thread,
    // while no other works.
    void begin(double up_to, double pieces) {
        begin_ = end_, end_ = up_to;
        pieces_ = std::max(pieces, 1.0);
        done_ = 0;
    }
    // False when all are to stop.
    bool add(double pieces) {
        const double done = done_ += pieces;
        if (progress_ && !is_cancelled_ && std::this_thread::get_id() == caller_ &&
            !progress_(begin_ + (end_ - begin_) * std::min(done / pieces_, 1.0), "measuring folds"))
            is_cancelled_ = true;
        return !is_cancelled_;
    }
    bool is_cancelled() const { return is_cancelled_; }

private:
    const Progress& progress_;
    std::thread::id caller_ = std::this_thread::get_id();
    double begin_ = 0, end_ = 0, pieces_ = 1;
    std::atomic<double> done_ = 0;
    std::atomic<bool> is_cancelled_ = false;
};

} // namespace unseen::perception
