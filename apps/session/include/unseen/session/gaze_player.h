// The gaze of every frame: from the head alone, recorded or simulated, as a tracker would tell it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include <unseen/perception/gaze.h>
#include <unseen/session/messages.h>
#include <unseen/session/observer.h>

namespace unseen::session {

enum class GazeSource {
    none,      // the program itself may know one, such as the mouse's
    mouse,     // likewise
    head,      // no tracker: within 15 degrees of the window's centre
    trace,     // a recording
    simulated, // fixations and saccades by published statistics
};

struct GazeOptions {
    GazeSource source = GazeSource::none;
    std::filesystem::path trace = {}; // of GazeSource::trace, see perception::read_gaze_recording()
    std::uint64_t seed = 1;           // of GazeSource::simulated
    perception::TrackerOptions tracker = {};
};

class GazePlayer {
public:
    // Reads the recording. Errors name its line, or the tracker's field.
    static Result<GazePlayer> create(const GazeOptions& options);

    // To be called before the first frame: puts a recording into the view's window and notes what was made of its file,
    // or simulates a gaze there, for frames up to `duration_s`; where nobody knows when they end, for an hour, after
    // which the eye keeps still. Fails where a recording has nothing for the frames; warns where it ends before them,
    // and its last gaze holds.
    Result<void> begin(const perception::Display& display, const vdtree::View& view, std::optional<double> duration_s,
                       const Messages& messages = {});

    // What is known at an instant. `own_px`: where the program knows the viewer to look, for sources that are not
    // played; the tracker's error is around it.
    std::optional<Gaze> at(double time_s, const vdtree::View& view, std::optional<glm::dvec2> own_px) const;
    std::optional<Gaze> around(std::optional<glm::dvec2> px) const; // with the tracker's error, whatever is played
    bool is_moving() const noexcept { return tracker_.has_value(); }

private:
    explicit GazePlayer(const GazeOptions& options) : options_(options) {}

    GazeOptions options_;
    std::optional<perception::GazeRecording> recording_; // until begin()
    std::optional<perception::GazeTracker> tracker_;
};

} // namespace unseen::session
