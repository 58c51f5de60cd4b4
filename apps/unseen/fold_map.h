// Pictures of what a fold test made of a cut: by the colour of each vertex's surroundings, what its fold cost, and why.
#pragma once

#include <string_view>
#include <vector>

#include <perception/image.h>
#include <vdtree/cut.h>

#include "options.h"
#include "scene.h"

namespace unseen::app {

enum class FoldMap {
    cost,         // of the fold test in use: 1 is just imperceptible
    frequency,    // cycles per degree of the worst grating, whose half-wave fills the ring
    contrast,     // Michelson, of the ring's luminances; of silhouettes, and anything in the scene
    eccentricity, // degrees from the gaze
};
inline constexpr std::string_view fold_map_names[] = {"cost", "frequency", "contrast", "eccentricity"};

// Draws the cut, which must be of the scene's tree and cut by `what`, as `view` sees it: a view of the scene's camera, whatever its size.
// Values are those of the scene's view. Around each vertex of the cut (up to the middle of the edges) is the value of the node that is
// folded there; vertices of the whole mesh are grey, the background is black. Below comes a scale. Code values. Preconditions: a
// gaze for the eccentricity, and for the cost not the mode full, in which nothing is folded. Cost: a test of every node, and a second for a million triangles.
Result<perception::Image> draw_fold_map(const vdtree::Cut& cut, const Scene& scene, const WhatOptions& what, FoldMap map, const vdtree::View& view);

} // namespace unseen::app
