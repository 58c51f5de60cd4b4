// What the frames of a flight came to: as CSV, as a plot, as JSON and in words.
#pragma once

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <panel_plot.h>
#include <unseen/session/session.h>

#include "options.h"
#include "report.h"

namespace unseen::app {

inline constexpr double not_drawn = std::numeric_limits<double>::quiet_NaN();

// One frame. Times in milliseconds of the wall clock.
struct FrameRecord {
    vdtree::AdjustStats stats;
    double cut_ms = 0;
    double index_ms = 0; // for the index buffer, where nothing is drawn
    double draw_ms = not_drawn, frame_ms = 0;
    double uploaded_bytes = not_drawn;
    double drawn_triangles = not_drawn, gliding = not_drawn;                   // of geomorphs
    double change_v = not_drawn, flicker_v = not_drawn, picture_v = not_drawn; // where changes are judged

    std::uint64_t changes() const { return stats.folds + stats.unfolds; }
};

// A line a frame, after a header.
std::string to_csv(const std::vector<FrameRecord>& frames);
PanelPlot plot_of(const std::vector<FrameRecord>& frames, const std::string& title);
// Medians and largest values of the frames after the first, which makes the cut.
Json to_json(const session::Session& session, const std::vector<FrameRecord>& frames, const session::Report& last);
void print(const session::Session& session, const std::vector<FrameRecord>& frames, const session::Report& last,
           const DisplayOptions& display);
void print_details(const std::vector<FrameRecord>& frames, const session::Report& last);

} // namespace unseen::app
