// The gaze in every frame: from the head alone, recorded, or simulated as an eye tracker would report it.
#pragma once

#include <unseen/perception/gaze.h>
#include <unseen/session/load.h>
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
    perception::GazeTracker::Options tracker = {};
};

class GazePlayer {
public:
    // Reads the recording. Errors name its line, or the tracker's field.
    static Result<GazePlayer> create(const GazeOptions& options);

    // Call this before the first frame. Maps a recording to the view's window and notes how its file was read, or
    // simulates a gaze there for `duration_s`; if that is not known, for an hour, after which the eye rests. Fails if
    // the recording has no sample for the frames. Warns if it ends before them; its last gaze then holds.
    Result<void> begin(const perception::Display& display, const vdtree::View& view, std::optional<double> duration_s,
                       const Messages& messages = {});

    // The gaze at a time. `own_px`: the program's own gaze, for sources that are not played; the tracker's error is its
    // margin.
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
