// What the pictures of a view mask.
#pragma once

#include <span>
#include <vector>

#include <unseen/perception/masking.h>
#include <unseen/render/internal/layers.h>
#include <unseen/session/session.h>
#include <unseen/session_gpu/scene_renderer.h>

namespace unseen::session {

// Objects by the depth of their centres. No layers: all are in one.
Result<render::LayerSplit> split_objects(const Session& session, const vdtree::View& view, int layers);

struct SceneMasks {
    std::vector<perception::MaskingPicture> of_objects; // what one layer masks is the same for all its objects
    float largest_share =
        0; // of all cells and bands of a layer's picture, in how many thresholds rise by a quarter or more
    int surface_passes = 0, full_screen_passes = 0;
    std::uint64_t texture_bytes = 0;
};

// Draws the scene, and it without each layer's objects, and maps what each picture masks; waits for the GPU after each.
// Shadows are those of the whole scene, whatever is drawn.
Result<SceneMasks> find_masks(const Session& session, const render::Context& context, const SceneItems& scene,
                              const vdtree::View& view, const render::LayerSplit& split, int samples);

} // namespace unseen::session
