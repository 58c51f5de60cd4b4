#include "gaze_player.h"

#include <string>
#include <utility>

#include "terminal.h"

namespace unseen::app {

Result<GazePlayer> GazePlayer::create(const GazeOptions& options) {
    if (auto valid = perception::validate(options.tracker); !valid) return valid.error();
    GazePlayer player(options);
    if (options.source == GazeSource::trace) {
        auto trace = perception::read_gaze_trace(options.trace);
        if (!trace) return trace.error();
        player.trace_ = std::move(*trace);
    }
    return player;
}

Result<void> GazePlayer::begin(const Scene& scene, std::optional<double> duration_s) {
    if (options_.source == GazeSource::simulated) {
        perception::SimulatedGaze simulated;
        simulated.seed = options_.seed;
        constexpr double spare_s = 1; // beyond the last frame
        constexpr double longest_s = 3600;
        simulated.duration_s = duration_s.value_or(longest_s) + spare_s;
        simulated.width_px = scene.view.width;
        simulated.height_px = scene.view.height;
        auto trace = perception::simulate_gaze(simulated, scene.display);
        if (!trace) return trace.error();
        trace_ = std::move(*trace);
    }
    if (options_.source == GazeSource::trace) {
        const double first_s = trace_->samples().front().time_s, last_s = trace_->samples().back().time_s;
        const std::string times = options_.trace + " runs from " + shortest(first_s) + " to " + shortest(last_s) + " s, and the frames from 0" +
                                  (duration_s ? " to " + shortest(*duration_s) + " s" : " on");
        if ((duration_s && first_s > *duration_s) || last_s < 0)
            return Error{ErrorCode::invalid_argument, times + ": count its times from the first frame."};
        if (duration_s && last_s < *duration_s) print_warning(times + ": after its end the last gaze holds.");
    }
    if (trace_) tracker_.emplace(*std::exchange(trace_, {}), options_.tracker, scene.display, scene.view.width, scene.view.height);
    return {};
}

void GazePlayer::apply(WhatOptions& what, const Scene& scene, double time_s) const {
    what.gaze_margin_deg = options_.tracker.error_deg;
    if (options_.source == GazeSource::head) {
        what.gaze_px = glm::dvec2(scene.view.width, scene.view.height) * 0.5;
        what.gaze_margin_deg += perception::head_only_margin.value();
    }
    if (!tracker_) return;
    const perception::TrackedGaze gaze = tracker_->at(time_s);
    what.gaze_px = gaze.px;
    what.gaze_margin_deg = gaze.margin_deg;
}

} // namespace unseen::app
