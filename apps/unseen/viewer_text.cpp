#include "viewer_text.h"

#include <algorithm>
#include <cmath>

#include "cut_report.h"
#include "terminal.h"

namespace unseen::app {
namespace {

using session::GazeSource;

// As people say it: two digits, and nothing of microseconds.
std::string time_text(double ms) {
    if (ms < 0.1) return "under 0.1 ms";
    return ms < 1000 ? rounded(ms, 2) + " ms" : duration(ms);
}

std::string gaze_text(const ViewerState& state) {
    const double margin = state.gaze->margin_deg;
    if (state.gaze_source == GazeSource::head)
        return "somewhere within " + rounded(margin, 3) + " degrees of the middle (dashed)";
    std::string text;
    switch (state.gaze_source) {
    case GazeSource::mouse: text = "the pointer"; break;
    case GazeSource::trace: text = "recorded"; break;
    case GazeSource::simulated: text = "simulated"; break;
    default: text = "pixel " + with_decimals(state.gaze->px.x, 0) + ", " + with_decimals(state.gaze->px.y, 0); break;
    }
    const glm::dvec2 px = state.gaze->px, window(state.window_px);
    const bool is_inside = px.x >= 0 && px.y >= 0 && px.x <= window.x && px.y <= window.y;
    text += is_inside ? "; the ring is the fovea, " + rounded(2 * session::fovea_degrees, 2) + " degrees"
                      : ", outside of the window";
    if (margin > 0) text += "; give or take " + rounded(margin, 2) + " (dashed)";
    return text;
}

} // namespace

std::string viewer_mode(const ViewerState& state) {
    if (state.is_draft) return "coarse";
    switch (state.goal.kind) {
    case session::Goal::Kind::full: return "whole";
    case session::Goal::Kind::budget: return "budget of " + grouped(state.goal.triangles);
    case session::Goal::Kind::pixels: return "up to " + rounded(state.goal.tolerance_px, 3) + " pixels";
    case session::Goal::Kind::quality: break;
    }
    const session::QualityFacts* const named = session::named_quality(state.goal);
    if (named && named->quality != session::Quality::invisible) return std::string(named->name);
    return state.gaze ? "gaze-directed" : "imperceptible";
}

std::string viewer_title(const ViewerState& state) {
    const session::Report& report = state.report;
    return state.model + " - " + viewer_mode(state) + ": " + grouped(report.stats.triangles) + " of " +
           grouped(report.source_triangles) + " triangles" + (report.stats.is_complete ? "" : ", refining") +
           (report.gliding > 0 ? ", gliding" : "") + " - Unseen";
}

std::vector<TextLine> viewer_lines(const ViewerState& state) {
    const session::Report& report = state.report;
    std::vector<TextLine> lines = {{triangles_text(report.stats.triangles, report.source_triangles), "shown"},
                                   {viewer_mode(state), "mode"}};
    if (state.is_draft) {
        lines.back().text += ", for now";
    } else if (state.goal.kind != session::Goal::Kind::full) {
        lines.push_back({seen_from_text(report, state.display), "visible"});
        if (!report.fold_tests.empty())
            lines.push_back({std::string(session::facts_of(report.fold_tests.front()).title), "fold test"});
    }
    if (state.gaze) lines.push_back({gaze_text(state), "gaze"});
    if (state.orthographic_height)
        lines.push_back({"in parallel, " + rounded(*state.orthographic_height, 3) + " m high", "view"});
    if (state.frame_ms)
        lines.push_back({time_text(*state.frame_ms) + " a frame" +
                             (state.adapt_ms ? ", " + time_text(*state.adapt_ms) + " of it to follow the view" : ""),
                         "time"});
    if (!report.stats.is_complete && state.limit_ms)
        lines.push_back({"refining, " + rounded(*state.limit_ms, 3) + " ms a frame", "limit"});
    for (const session::Effect& effect : report.passes)
        lines.push_back({(effect.on ? "on, " : "off, ") + effect.why, effect.name});
    if (report.gliding > 0) lines.push_back({grouped(report.gliding) + " vertices", "gliding"});
    lines.push_back({"press h", "keys"});
    return lines;
}

const std::vector<TextLine>& viewer_keys() {
    static const std::vector<TextLine> keys = {
        {"the whole model", "1"},
        {"imperceptible: what nobody can see is gone", "2"},
        {"a budget of triangles; + and - change it", "3"},
        {"full detail only where you look: at the pointer", "4"},
        {"turn the model", "drag"},
        {"move it (or drag with the middle or right button)", "shift + drag"},
        {"nearer, farther", "wheel"},
        {"in parallel (orthographic) or in perspective", "o"},
        {"the first view again", "r"},
        {"edges of triangles", "w"},
        {"flat or smooth", "f"},
        {"screenshot of the model, without text and ring", "s"},
        {"screenshot of the window as it is", "S"},
        {"hide text and ring, show them again", "i"},
        {"these keys", "h"},
        {"quit", "q, Esc"},
    };
    return keys;
}

std::string viewer_help() {
    std::size_t widest = 0;
    for (const TextLine& key : viewer_keys()) widest = std::max(widest, key.lead.size());
    std::string help = "Keys and mouse:\n";
    for (const TextLine& key : viewer_keys())
        help += "  " + key.lead + std::string(widest + 2 - key.lead.size(), ' ') + key.text + "\n";
    return help;
}

} // namespace unseen::app
