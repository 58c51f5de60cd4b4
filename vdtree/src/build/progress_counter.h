// Tells the caller of something that many threads do how far it is.
#pragma once

#include <algorithm>
#include <atomic>
#include <thread>

#include <unseen/vdtree/mesh.h>

namespace unseen::vdtree {

// Calls the caller's callback on the caller's own thread only, and tells everybody whether to stop.
class ProgressCounter {
public:
    // `all`: what is to be done, in any unit.
    ProgressCounter(Progress progress, std::size_t all)
        : progress_(std::move(progress)), all_(static_cast<double>(std::max<std::size_t>(all, 1))) {}

    // False when all are to stop.
    bool add(std::size_t done) {
        done_ += done;
        if (progress_ && std::this_thread::get_id() == caller_ && !stopped_ &&
            !progress_(std::min(1.0, static_cast<double>(done_) / all_), "clustering"))
            stopped_ = true;
        return !stopped_;
    }
    bool stopped() const { return stopped_; }

private:
    Progress progress_; // its own copy: a helping process has none, and an empty one must live as long
    std::thread::id caller_ = std::this_thread::get_id();
    double all_;
    std::atomic<std::size_t> done_ = 0;
    std::atomic<bool> stopped_ = false;
};

} // namespace unseen::vdtree
