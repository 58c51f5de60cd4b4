// Where the viewer looks, and how surely that is known.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include <glm/vec2.hpp>

#include <perception/csf.h>
#include <perception/display.h>
#include <vdtree/result.h>

namespace unseen::perception {

// Pixels of the window from the top left; may lie outside.
struct GazeSample {
    double time_s = 0;
    glm::dvec2 px = glm::dvec2(0);
    bool operator==(const GazeSample&) const = default;
};

// Recorded or simulated: linear between samples, which ascend strictly in time; the first before, the last after them.
// Not empty.
class GazeTrace {
public:
    // Fails on no samples, times that do not ascend, gaps longer than `longest_gap_s`, and non-finite numbers, naming
    // the index.
    static Result<GazeTrace> create(std::vector<GazeSample> samples);
    static constexpr double longest_gap_s = 1; // a blink takes up to 0.4 s; longer, the tracker lost the eye

    const std::vector<GazeSample>& samples() const noexcept { return samples_; }
    double duration_s() const noexcept { return samples_.back().time_s - samples_.front().time_s; }
    glm::dvec2 at(double time_s) const;

private:
    explicit GazeTrace(std::vector<GazeSample> samples) : samples_(std::move(samples)) {}
    std::vector<GazeSample> samples_;
};

// CSV with the header "time_s,x_px,y_px" and one sample a line; empty lines and those that begin with # are skipped.
// Times out of order, gaps and bad numbers are errors that name the file and the line.
Result<GazeTrace> read_gaze_trace(const std::filesystem::path& file);
Result<void> write_gaze_trace(const std::filesystem::path& file, const GazeTrace& trace);

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

// What a tracker makes of a gaze.
struct TrackerOptions {
    double error_deg = 0; // radius within which the true gaze lies
    double latency_s = 0; // from the eye to the picture
    // Follow nothing during saccades, when nothing is seen (Volkmann 1986): what was known before one holds from its
    // onset to `suppressed_s` after it, at least to its end.
    bool suppression = false;
    double suppressed_s = 0.05;
};

// What a renderer knows at an instant.
struct TrackedGaze {
    glm::dvec2 px = glm::dvec2(0); // where the eye was `latency` ago
    // Everything may be so much nearer to the true gaze: eccentricities shrink to max(0, e - margin), margin = error +
    // speed latency.
    double margin_deg = 0;
    double speed_deg_s = 0;
    bool is_suppressed = false;
};

inline constexpr double saccade_speed_deg_s =
    50; // faster than any pursuit of a slow object, slower than any saccade of a degree

// The same trace and options give the same run.
class GazeTracker {
public:
    // Preconditions: validate() accepts the options and the display, and the window is at least 1x1 pixels.
    GazeTracker(GazeTrace trace, const TrackerOptions& options, const Display& display, int width_px, int height_px);
    TrackedGaze at(double time_s) const;

private:
    double speed_at(double time_s) const; // degrees a second

    GazeTrace trace_;
    TrackerOptions options_;
    double tangent_per_pixel_;
    glm::dvec2 centre_px_;
    std::vector<std::pair<double, double>> saccades_; // from, to; in seconds, ascending
};

// Finite; 0 or more. The error names the field.
Result<void> validate(const TrackerOptions& options);

// Without a tracker the head alone says where the viewer looks: the eyes stay within so much of straight ahead.
inline constexpr Degrees head_only_margin{15};

// The table as it is for a viewer whose gaze is known to a margin only: S'(e) = S(max(0, e - margin)), up to the 180
// degrees that a table can have; beyond the last column that stays below them, what it sees or one that is left out,
// whichever is more. Margins below CsfTable::smallest_spacing count as it, but for 0. Where the margin is 180 degrees
// or more, infinite or NaN, everything is seen as it is best seen anywhere. Precondition: not below 0.
CsfTable widened(const CsfTable& table, Degrees margin);

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
