// Levels of detail side by side, as they look where each begins, and from near by.
#pragma once

#include <string>

#include <unseen/perception/image.h>
#include <unseen/render/context.h>
#include <unseen/session/session.h>
#include <unseen/session_gpu/lod.h>

namespace unseen::app {

// A column for each level below the full mesh, from top to bottom: the full mesh at the level's distance, and the level,
// pixels of the display made large; then the level from near by, and its triangles. Code values. Fails on scenes of
// several objects (unsupported) and where there is no level below the full mesh (invalid_argument).
Result<perception::Image> draw_level_sheet(const session::Session& session, const render::Context& context,
                                           const session::Lod& lod, const std::string& title);

} // namespace unseen::app
