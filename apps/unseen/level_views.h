// Pictures of levels in use: the scene, its layers, what masks, and which level each object has.
#pragma once

#include <optional>

#include <unseen/perception/image.h>
#include <unseen/render/renderer.h>
#include <unseen/render/target.h>
#include <unseen/session_gpu/level_control.h>

namespace unseen::app {

// In place of the picture.
enum class LevelView {
    layers,       // the background and each layer
    combinations, // for each layer, all the others
    maps,         // for each layer, which steps of luminance those hide
    levels,       // the picture, coloured by level
};

Result<render::Frame> frame_of(const render::Target& target);
// `levels`: of the object with the most.
Result<perception::Image> picture_of(session::LevelControl& control, const perception::Display& display,
                                     const std::optional<LevelView>& show, int levels);

} // namespace unseen::app
