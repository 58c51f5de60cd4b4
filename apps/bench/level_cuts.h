// The cuts that a frame of discrete levels shows, for judging them as other cuts are judged.
#pragma once

#include <vector>

#include <unseen/session/session.h>
#include <unseen/session_gpu/level_control.h>

namespace unseen::app {

// By object. What is out of the window is whole where it may cast shadows into it, and else not there.
std::vector<vdtree::Cut> level_cuts(const session::Session& session, const session::LevelControl& control,
                                    const session::LevelFrame& frame);

} // namespace unseen::app
