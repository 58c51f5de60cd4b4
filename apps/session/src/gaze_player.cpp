#include <unseen/session/gaze_player.h>

#include <unseen/vdtree/internal/number_text.h>

namespace unseen::session {

Result<GazePlayer> GazePlayer::create(const GazeOptions& options) {
    if (auto valid = perception::validate(options.tracker); !valid) return valid.error();
    GazePlayer player(options);
    if (options.source == GazeSource::trace) {
        auto recording = perception::read_gaze_recording(options.trace);
        if (!recording) return recording.error();
        player.recording_ = std::move(*recording);
    }
    return player;
}

Result<void> GazePlayer::begin(const perception::Display& display, const vdtree::View& view,
                               std::optional<double> duration_s, const Messages& messages) {
    const auto play = [&](Result<perception::GazeTrace> trace) -> Result<void> {
        if (!trace) return trace.error();
        tracker_.emplace(std::move(*trace), options_.tracker, display, view.width, view.height);
        return {};
    };
    if (options_.source == GazeSource::simulated) {
        perception::SimulatedGaze simulated;
        simulated.seed = options_.seed;
        constexpr double spare_s = 1; // beyond the last frame
        constexpr double longest_s = 3600;
        simulated.duration_s = duration_s.value_or(longest_s) + spare_s;
        simulated.width_px = view.width;
        simulated.height_px = view.height;
        return play(perception::simulate_gaze(simulated, display));
    }
    if (!recording_) return {};
    const perception::GazeRecording recording = *std::exchange(recording_, {});
    const std::string file = options_.trace.string();
    if (messages.note)
        for (const std::string& note : recording.notes) messages.note(file + ": " + note);
    const double first_s = recording.trace.samples().front().time_s, last_s = recording.trace.samples().back().time_s;
    const std::string times = file + " runs from " + number_text(first_s) + " to " + number_text(last_s) +
                              " s, and the frames from 0" +
                              (duration_s ? " to " + number_text(*duration_s) + " s" : " on");
    if ((duration_s && first_s > *duration_s) || last_s < 0)
        return Error{ErrorCode::invalid_argument, times + ": count its times from the first frame."};
    if (duration_s && last_s < *duration_s && messages.warning)
        messages.warning(times + ": after its end the last gaze holds.");
    return play(recording.in_window(view.width, view.height));
}

std::optional<Gaze> GazePlayer::around(std::optional<glm::dvec2> px) const {
    if (!px) return std::nullopt;
    return Gaze{*px, options_.tracker.error_deg};
}

std::optional<Gaze> GazePlayer::at(double time_s, const vdtree::View& view, std::optional<glm::dvec2> own_px) const {
    if (tracker_) {
        const perception::GazeTracker::Gaze gaze = tracker_->at(time_s);
        return Gaze{gaze.px, gaze.margin_deg};
    }
    if (options_.source != GazeSource::head) return around(own_px);
    return Gaze{glm::dvec2(view.width, view.height) * 0.5,
                options_.tracker.error_deg + perception::head_only_margin.value()};
}

} // namespace unseen::session
