// A walk through a scene with one cut an object, frame by frame, as `unseen render --path walk` goes.
#pragma once

#include <cstddef>
#include <optional>

#include <unseen/session/session.h>
#include <unseen/session_gpu/moving_occlusion.h>
#include <unseen/session_gpu/picture_judge.h>
#include <unseen/session_gpu/scene_renderer.h>

namespace unseen::app {

// Towards the target at walking speed; the target goes along. Frame 0 is the first view itself.
vdtree::View view_on_walk(const vdtree::View& first, int frame);

struct TreeWalkOptions {
    int frames = 40;       // after the first: enough for a try of what is not always on
    int first_counted = 1; // frames before have no pictures of depth yet
    std::optional<session::MovingOcclusionOptions> occlusion = {}; // none: nothing is hidden by pictures
    const session::PictureJudge* judge = nullptr; // of the last view, by the same renderer; null: nothing is judged
};

struct TreeWalk {
    double triangles = 0, frame_ms = 0, occlusion_ms = 0; // means, of the frames that count
    std::size_t pictures = 0;                             // of depth
    session::PassEffect effect;
    std::optional<session::PictureVerdict> verdict = {}; // of the last frame
};

// Cuts are followed, and drawn with one sample a pixel by the session's renderer. Fails as these do.
Result<TreeWalk> walk_tree(const session::Session& session, const render::Context& context,
                           session::SceneRenderer& renderer, const vdtree::View& first, const TreeWalkOptions& options);

} // namespace unseen::app
