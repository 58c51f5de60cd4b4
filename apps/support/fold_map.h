// Pictures of what a fold test made of a cut: by the colour of each vertex's surroundings, what its fold cost, and why.
#pragma once

#include <string_view>
#include <vector>

#include <unseen/perception/image.h>
#include <unseen/session/session.h>
#include <unseen/vdtree/cut.h>

namespace unseen::app {

enum class FoldMap {
    cost,         // of the fold test in use: 1 is just imperceptible
    frequency,    // cycles per degree of the worst grating, whose half-wave fills the ring
    contrast,     // Michelson, of the ring's luminances; of silhouettes, and anything in the scene
    eccentricity, // degrees from the gaze
};
inline constexpr std::string_view fold_map_names[] = {"cost", "frequency", "contrast", "eccentricity"};

// Draws the cut of the session's only object, made by `request` for `seen`, as `view` sees it: the same camera,
// whatever its size. Values are those of `seen`. Around each vertex of the cut (up to the middle of the edges) is the
// value of the node that is folded there; vertices of the whole mesh are grey, the background is black. Below comes a
// scale. Code values. Preconditions: a gaze for the eccentricity, and for the cost not the full model, in which nothing
// is folded. Cost: a test of every node, and a second for a million triangles.
Result<perception::Image> draw_fold_map(const vdtree::Cut& cut, session::Session& session, const vdtree::View& seen,
                                        const session::Request& request, FoldMap map, const vdtree::View& view);

} // namespace unseen::app
