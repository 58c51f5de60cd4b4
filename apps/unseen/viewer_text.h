// What the viewer says: its title, the lines over its picture, and its keys.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <unseen/session/gaze_player.h>
#include <unseen/session/session.h>

#include "screen_text.h"

namespace unseen::app {

// What there is to say of a frame.
struct ViewerState {
    std::string model;     // its file's name
    bool is_draft = false; // coarse, while the view moves or what the goal needs is being made
    session::Goal goal = {};
    session::Report report = {};
    perception::Display display = {};
    glm::ivec2 window_px = glm::ivec2(0);
    std::optional<double> orthographic_height = {};              // of the view, metres
    std::optional<session::Gaze> gaze = {};                      // that the cut is made for
    session::GazeSource gaze_source = session::GazeSource::none; // of it; none: a pixel that was asked for
    std::optional<double> limit_ms = {};                         // of following the view
    std::optional<double> frame_ms = {}, adapt_ms = {};          // of the last frames; adapt is a part of frame
};

// "whole", "imperceptible", "gaze-directed", "budget of 10,000", "up to 5 pixels", "coarse".
std::string viewer_mode(const ViewerState& state);
// "bunny.vdt - imperceptible: 34,294 of 69,666 triangles - Unseen"; before the program's name what still goes on.
std::string viewer_title(const ViewerState& state);
std::vector<TextLine> viewer_lines(const ViewerState& state);

// The keys and the mouse, and what they do.
const std::vector<TextLine>& viewer_keys();
// The same for a terminal, in lines.
std::string viewer_help();

} // namespace unseen::app
