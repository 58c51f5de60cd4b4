// Pictures of a scene whose objects have discrete levels of detail: one, or along a camera's path.
#pragma once

#include <optional>
#include <string>

#include <unseen/session_gpu/level_control.h>

#include "level_views.h"
#include "options.h"

namespace unseen::app {

struct LevelFlightOptions {
    session::LevelControlOptions control;
    std::string path; // see camera_path.h; empty: one picture, of the view in which nothing changes any more
    std::string out;  // of pictures: with a path a name with one %d; empty: none
    std::string json;
    std::string selection; // of the method `given`: a file, whose budget counts unless `what` has one
    std::optional<LevelView> show;
    double frames_a_second = 60;
    WhatOptions what;
    bool is_verbose = false;
};

// Prints a summary, and writes what was asked for.
Result<void> draw_levels(const std::string& model, const ViewOptions& view, const DisplayOptions& display,
                         const LevelFlightOptions& options);

} // namespace unseen::app
