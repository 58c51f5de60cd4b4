#include "gaze_player.h"

namespace unseen::app {

Result<GazePlayer> GazePlayer::create(const GazeOptions& options, const Scene& scene, double duration_s) {
    if (auto valid = perception::validate(options.tracker); !valid) return valid.error();
    GazePlayer player(options);
    const auto play = [&](perception::GazeTrace trace) {
        player.tracker_.emplace(std::move(trace), options.tracker, scene.display, scene.view.width, scene.view.height);
    };
    if (options.source == GazeSource::trace) {
        auto trace = perception::read_gaze_trace(options.trace);
        if (!trace) return trace.error();
        play(std::move(*trace));
    }
    if (options.source == GazeSource::simulated) {
        perception::SimulatedGaze simulated;
        simulated.seed = options.seed;
        constexpr double spare_s = 1; // beyond the last frame
        simulated.duration_s = duration_s + spare_s;
        simulated.width_px = scene.view.width;
        simulated.height_px = scene.view.height;
        auto trace = perception::simulate_gaze(simulated, scene.display);
        if (!trace) return trace.error();
        play(std::move(*trace));
    }
    return player;
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
