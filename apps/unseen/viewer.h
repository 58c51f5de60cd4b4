// The interactive viewer: a window in which a model is orbited while its cut follows.
#pragma once

#include <optional>
#include <string>

#include <unseen/render/context.h>
#include <unseen/render/renderer.h>
#include <unseen/session/session.h>

#include "options.h"

namespace unseen::app {

struct ViewerOptions {
    std::string model; // the file's name, for the title
    vdtree::View first_view;
    WhatOptions what;                                            // to begin with
    session::GazeSource gaze_source = session::GazeSource::none; // none: a pixel that was asked for, if any
    bool has_fixed_field = false; // the camera's field was asked for; else it follows the window's height
    render::DrawOptions draw;
    std::string screenshot;                 // of the model alone, written when the viewer ends
    std::optional<double> geomorph_seconds; // that vertices glide for; none: they do not
    int frames = 0;                         // after which it ends; 0: when the user wants to
};

// Shows the window and runs until it is closed. On the main thread only. Screenshots that somebody asks for in the
// window and that cannot be written are told of, and are no failure.
Result<void> run_viewer(render::Context& window, session::Session& session, session::GazePlayer gaze,
                        const ViewerOptions& options);

} // namespace unseen::app
