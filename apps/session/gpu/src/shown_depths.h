// What views show of a scene, as depths.
#pragma once

#include <unseen/session_gpu/scene_renderer.h>
#include <unseen/vdtree/depth_picture.h>

namespace unseen::session {

// Why pictures tell nothing about the folds of a simplification; null where they do.
const char* why_pictures_tell_nothing(const Session& session, const Request& request, const Simplification& made);

Result<vdtree::DepthPicture> draw_depths(const render::Context& context, const SceneItems& scene,
                                         const vdtree::View& view, int samples);

} // namespace unseen::session
