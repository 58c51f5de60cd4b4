// Pictures of levels in use: the scene, what masks, and which level each object has.
#pragma once

#include <optional>

#include <unseen/perception/image.h>
#include <unseen/render/renderer.h>
#include <unseen/render/target.h>
#include <unseen/session_gpu/level_control.h>

namespace unseen::app {

// In place of the picture.
enum class LevelView {
    maps,   // for each layer of depth, which steps of luminance the others hide
    levels, // the picture, coloured by level
};

Result<render::Frame> frame_of(const render::Target& target);
// `levels`: of the object with the most.
Result<perception::Image> picture_of(session::LevelControl& control, const perception::Display& display,
                                     const std::optional<LevelView>& show, int levels);

} // namespace unseen::app
