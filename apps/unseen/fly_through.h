// A camera's path through a scene, with one cut that follows it.
#pragma once

#include <optional>
#include <string>

#include <unseen/render/renderer.h>

#include "options.h"

namespace unseen::app {

struct FlyThroughOptions {
    std::string path;     // see camera_path.h
    std::string pictures; // a name with one %d (or %04d, ...) for the frame's number; empty: no pictures
    std::string csv, plot, json;
    std::optional<bool> draws; // default: where there are pictures to write
    bool is_verbose = false;
    bool judges_changes = false; // whether one sees the cut change, frame by frame: draws, see flight_changes.h
    std::optional<double> geomorph_seconds; // that vertices glide for; not set: they jump
    double frames_a_second = 60;            // of the glides, moving gazes and moving lights
    WhatOptions what;
    GazeOptions gaze;
    render::DrawOptions draw;
};

// Prints a summary, and writes what was asked for. If the user interrupts it, the rows and pictures so far are kept. Reads
// and checks all files before anything that takes long, such as the fold errors that the fold test may need.
Result<void> fly_through(const std::string& model, const ViewOptions& view, const DisplayOptions& display,
                         const FlyThroughOptions& options);

} // namespace unseen::app
