// Where the viewer looks, and how surely that is known.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>

#include <glm/vec2.hpp>

#include <unseen/perception/csf.h>
#include <unseen/perception/display.h>

namespace unseen::perception {

// Recorded or simulated: linear between samples, which ascend strictly in time; the first before, the last after them.
// Not empty.
class GazeTrace {
public:
    // Pixels of the window from the top left; may lie outside.
    struct Sample {
        double time_s = 0;
        glm::dvec2 px = glm::dvec2(0);
        bool operator==(const Sample&) const = default;
    };

    // Fails on no samples, times that do not ascend, gaps longer than `longest_gap_s`, and non-finite numbers, naming
    // the index.
    static Result<GazeTrace> create(std::vector<Sample> samples);
    static constexpr double longest_gap_s = 1;
    static constexpr double farthest_px = 1e6;              // from the window's corner: a thousand windows away
    static constexpr std::size_t most_samples = 10'000'000; // of files and simulations

    const std::vector<Sample>& samples() const noexcept { return samples_; }
    double duration_s() const noexcept { return samples_.back().time_s - samples_.front().time_s; }
    glm::dvec2 at(double time_s) const;

private:
    explicit GazeTrace(std::vector<Sample> samples) : samples_(std::move(samples)) {}
    std::vector<Sample> samples_;
};

// A recording as a tracker's program wrote it.
struct GazeRecording {
    GazeTrace trace;
    bool is_normalised = false;     // not pixels, but shares of the window from its top left
    std::vector<std::string> notes; // sentences about what was made of the file and is not plain from its names

    // In pixels of a window. Fails on sizes that put a sample farther away than traces have them.
    Result<GazeTrace> in_window(int width_px, int height_px) const;
};

// Samples that a tracker is less sure of are gaps: what Pupil Labs recommend for their `confidence`.
inline constexpr double least_confidence = 0.6;
// Blinks take 0.1 to 0.4 s (Schiffman 2001); longer, the tracker lost the eye.
inline constexpr double longest_blink_s = 0.4;

// A table in UTF-8 with a header and one sample a row, separated by tabs, semicolons or commas, as the header is. Empty
// lines and those that begin with # are skipped.
//
// Columns are known by their names, whatever their case, spaces and underscores; others are ignored.
// - Time: "time", "t", or the timestamps of Tobii, Pupil Labs and EyeLink. The unit is part of the name ("time_ms",
//   "timestamp [ns]"; s, ms, us, ns), that of the program whose name it is, or seconds. Timestamps are a clock's and
//   count from the first row; "time" and Tobii's "Recording timestamp" stay as they are.
// - Position: "x" and "y", with "gaze", "gaze point", "left", "right" before or behind: "Gaze point left X [DACS px]",
//   "LEFT_GAZE_X", "gaze x [px]", "x_norm"; and Pupil's "norm_pos_x", "norm_pos_y", whose y points up. Pixels come
//   before shares of the screen, and these before those of Tobii's media (MCS). Where no name says which, they are
//   shares if all are within -0.5..1.5. Of two eyes, the mean of those that are seen, unless the file has it.
// - Whether the eye is seen: "confidence" (see `least_confidence`), "Validity left" and "right" of Tobii,
//   "LEFT_IN_BLINK" of EyeLink, "worn" and "blink id" of Pupil Labs.
//
// Rows without a position (empty, NaN, ".", NA) and with an eye that is not seen are gaps. The last position holds in
// them, and the first before it: during a blink nothing is seen (Volkmann, Riggs & Moore 1980), and a glide would be a
// movement that nobody made. Of rows with the same time the last with a position counts.
//
// Errors name the file, the line and the column. Times that fall are errors, and rows more than
// `GazeTrace::longest_gap_s` apart.
Result<GazeRecording> read_gaze_recording(const std::filesystem::path& file);

// Fixations and saccades by published statistics. Fixations: log-normal durations of median 250 ms (Rayner 1998: 200 to
// 330 ms). Saccades: amplitudes of a gamma distribution of shape 2 and mean 5.5 degrees, cut at 20; durations 2.2 A +
// 21 ms (Carpenter 1988), along the minimum-jerk curve, whose peak velocity 1.875 A / duration is near the main
// sequence 600 (1 - exp(-A / 6)) deg/s (Dai 2016). Targets are inside of the window.
struct SimulatedGaze {
    std::uint64_t seed = 1;
    double duration_s = 10;
    double samples_per_s = 250;
    int width_px = 1024, height_px = 1024; // the window, centred on the display
};
// Amplitudes are angles on the display's tangent plane. At most ten million samples; larger ones fail.
Result<GazeTrace> simulate_gaze(const SimulatedGaze& options, const Display& display);

inline constexpr double saccade_speed_deg_s =
    50; // faster than any pursuit of a slow object, slower than any saccade of a degree

// What a tracker makes of a gaze. The same trace and options give the same run.
class GazeTracker {
public:
    struct Options {
        double error_deg = 0; // radius within which the true gaze lies
        double latency_s = 0; // from the eye to the picture
        // Follow nothing during saccades, when nothing is seen (Volkmann 1986): what was known before one holds from its
        // onset to `suppressed_s` after it, at least to its end.
        bool suppression = false;
        double suppressed_s = 0.05;
    };

    // What a renderer knows at an instant.
    struct Gaze {
        glm::dvec2 px = glm::dvec2(0); // where the eye was `latency` ago
        // Everything may be so much nearer to the true gaze: eccentricities shrink to max(0, e - margin), margin = error +
        // speed latency.
        double margin_deg = 0;
        double speed_deg_s = 0;
    };

    // Preconditions: validate() accepts the options and the display, and the window is at least 1x1 pixels.
    GazeTracker(GazeTrace trace, const Options& options, const Display& display, int width_px, int height_px);
    Gaze at(double time_s) const;

private:
    double speed_at(double time_s) const; // degrees a second

    GazeTrace trace_;
    Options options_;
    double tangent_per_pixel_;
    glm::dvec2 centre_px_;
    std::vector<std::pair<double, double>> saccades_; // from, to; in seconds, ascending
};

// Finite; 0 or more. The error names the field.
Result<void> validate(const GazeTracker::Options& options);

// Without a tracker the head alone says where the viewer looks: the eyes stay within so much of straight ahead.
inline constexpr Degrees head_only_margin{15};

// Keeps widened tables. Margins are rounded up to one of a few, so that not every frame needs a table of its own.
class WidenedTables {
public:
    explicit WidenedTables(CsfTable table) : table_(std::move(table)) {}
    // Null where the margin is so wide that everything may be looked at, or NaN.
    std::shared_ptr<const CsfTable> at(Degrees margin);

private:
    CsfTable table_;
    std::map<double, std::shared_ptr<const CsfTable>> widened_;
};

} // namespace unseen::perception
