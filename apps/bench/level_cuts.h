// The cuts that a frame of discrete levels shows, for judging them as other cuts are judged.
#pragma once

#include <vector>

#include <unseen/session/session.h>
#include <unseen/session_gpu/level_control.h>

namespace unseen::app {

// By object. What is out of the window is whole if it may cast shadows into it, and else not there.
inline std::vector<vdtree::Cut> level_cuts(const session::Session& session, const session::LevelControl& control,
                                           const session::LevelFrame& frame) {
    const auto& lights = session.scene().lights;
    const bool casts = lights && !lights->casting().empty();
    std::vector<vdtree::Cut> cuts;
    for (std::size_t i = 0; i < frame.levels.size(); ++i) {
        if (frame.levels[i] >= 0) cuts.push_back(control.chain(i).cut(frame.levels[i]));
        else if (cuts.emplace_back(session.tree(i)); casts) cuts.back().unfold_all();
    }
    return cuts;
}

} // namespace unseen::app
