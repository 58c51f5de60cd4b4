// The interactive viewer: a window in which a model is orbited while its cut follows.
#pragma once

#include <optional>
#include <string>

#include <render/context.h>
#include <render/renderer.h>
#include <session/session.h>

#include "options.h"

namespace unseen::app {

struct ViewerOptions {
    vdtree::View first_view;
    WhatOptions what; // to begin with
    bool gaze_follows_pointer = false;
    bool has_fixed_field = false; // the camera's field was asked for; else it follows the window's height
    render::DrawOptions draw;
    std::string screenshot;                 // written when the viewer ends
    std::optional<double> geomorph_seconds; // that vertices glide for; none: they do not
    int frames = 0;                         // ends after so many; 0: when the user wants to
};

// The keys, for people.
extern const char* const viewer_help;

// Shows the window and runs until it is closed. On the main thread only.
Result<void> run_viewer(render::Context& window, session::Session& session, session::GazePlayer gaze,
                        const ViewerOptions& options);

} // namespace unseen::app
