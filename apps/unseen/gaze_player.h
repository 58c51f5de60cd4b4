// The gaze of every frame, from where the options say.
#pragma once

#include <optional>

#include <perception/gaze.h>

#include "options.h"
#include "scene.h"

namespace unseen::app {

class GazePlayer {
public:
    // Reads the trace.
    static Result<GazePlayer> create(const GazeOptions& options);

    // To be called before the first frame: simulates a gaze that is to be simulated, in the scene's window, for frames up to `duration_s`;
    // where nobody knows when they end, for an hour, after which the eye keeps still. Fails where a recording has nothing for the frames;
    // warns where it ends before them, and its last gaze holds.
    Result<void> begin(const Scene& scene, std::optional<double> duration_s);

    // Puts what is known at an instant into `what`. A gaze that the options do not play, such as the mouse's, stays as it
    // is, with the tracker's error around it.
    void apply(WhatOptions& what, const Scene& scene, double time_s) const;
    double tracker_error_deg() const noexcept { return options_.tracker.error_deg; }
    bool is_moving() const noexcept { return tracker_.has_value(); }

private:
    explicit GazePlayer(const GazeOptions& options) : options_(options) {}

    GazeOptions options_;
    std::optional<perception::GazeTrace> trace_; // until begin()
    std::optional<perception::GazeTracker> tracker_;
};

} // namespace unseen::app
