// The GLSL files under shaders/, embedded by EmbedFiles.cmake. They have no #version line: program.cpp puts it first.
#pragma once

#include <string_view>

namespace unseen::render::shaders {

extern const std::string_view accumulate_frag;
extern const std::string_view blur_frag;
extern const std::string_view change_cut_comp;
extern const std::string_view combine_frag;
extern const std::string_view compare_frag;
extern const std::string_view elevate_frag;
extern const std::string_view energy_frag;
extern const std::string_view examine_comp;
extern const std::string_view full_screen_vert;
extern const std::string_view halve_frag;
extern const std::string_view index_cut_comp;
extern const std::string_view lighting_glsl;
extern const std::string_view luminance_frag;
extern const std::string_view move_comp;
extern const std::string_view overlay_frag;
extern const std::string_view planes_glsl;
extern const std::string_view pool_frag;
extern const std::string_view power_frag;
extern const std::string_view reduce_frag;
extern const std::string_view sight_frag;
extern const std::string_view smooth_frag;
extern const std::string_view split_frag;
extern const std::string_view stipple_frag;
extern const std::string_view surface_vert;
extern const std::string_view surface_geom;
extern const std::string_view surface_frag;
extern const std::string_view test_pattern_frag;
extern const std::string_view unpack_frag;

} // namespace unseen::render::shaders
