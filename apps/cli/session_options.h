// From the options of a verb to what the session library takes.
#pragma once

#include <filesystem>

#include <unseen/session/session.h>

#include "options.h"

namespace unseen::app {

// Notes and warnings to the terminal, with the names of options.
session::Messages terminal_messages();

// The display that the options describe; ranges are checked.
Result<perception::Display> make_display(const DisplayOptions& options);
// Who looks at that display, without a gaze.
Result<session::Observer> make_observer(const DisplayOptions& options, const perception::Display& display);

// Fails on a file that cannot be read, and on options that contradict the model or the display. What is quickly read is
// read first.
Result<session::Session> open_session(const std::filesystem::path& model, const ViewOptions& view,
                                      const DisplayOptions& display);
// The same of a tree that is at hand.
Result<session::Session> make_session(vdtree::VertexTree tree, const ViewOptions& view, const DisplayOptions& display);

// What is not given is as the session frames its scene.
vdtree::View make_view(const session::Session& session, const ViewOptions& options);

// The gaze of --gaze, for verbs without another one.
std::optional<session::Gaze> fixed_gaze(const WhatOptions& what);

} // namespace unseen::app
