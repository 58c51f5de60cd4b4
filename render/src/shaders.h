// The GLSL files under shaders/, embedded by EmbedFiles.cmake. They have no #version line: program.cpp puts it first.
#pragma once

#include <string_view>

namespace unseen::render::shaders {

extern const std::string_view accumulate_frag;
extern const std::string_view full_screen_vert;
extern const std::string_view move_comp;
extern const std::string_view overlay_frag;
extern const std::string_view patch_comp;
extern const std::string_view surface_vert;
extern const std::string_view surface_geom;
extern const std::string_view surface_frag;
extern const std::string_view test_pattern_frag;

} // namespace unseen::render::shaders
