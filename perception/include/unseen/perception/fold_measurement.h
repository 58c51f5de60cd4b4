// What folding each node of a tree changes, measured: for error_distances() in <unseen/perception/criterion.h>.
#pragma once

#include <span>

#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::perception {

// The tree with what its folds change, under its light and with its luminances as they are, as attributes (fold_errors,
// fold_facing, fold_stage, fold_stages and fold_measurement; docs/file-format.md), which files keep. Everything else is
// shared with the given tree. Folds err less with proxies whose luminances conserve the light: see
// vdtree::conserve_light(), to be called before.
//
// Compared are small pictures of both surfaces, seen along the node's normal; points: the children's proxies, leaves
// spread over the support, the leaves that were worst in the children, and three points of the edges that the fold
// moves; and pictures of the whole mesh, folded in stages (none where vertices are translucent). Kept are the numbers
// as they were measured, with the settings of the measurement; what they come to for an eye is decided when a criterion
// is made.
//
// A measurement, not a bound over all cuts: neighbours may be folded in other ways, and the pictures' cells and the
// points are few.
//
// With a texture, what is seen of it at the texture coordinates that the surfaces have there is compared, and detail finer
// than the pictures' cells counts by how far the fold slides it over the surface (fold_texture).
//
// Fails where check() does, and where knows_texture() is false. Cost: some 25 us a node, and a second; some two to four
// times that with a texture; in parallel. The result does not depend on the threads. `threads`: 0: all cores. Progress is told, and can
// cancel, up to the whole mesh's pictures.
Result<vdtree::VertexTree> measure_folds(const vdtree::VertexTree& tree, int threads = 0,
                                         const Progress& progress = {});

// Whether a tree has no texture, or one over vertices of one hue. Those of several hues show different luminances of one
// texel, which is not measured. Cost: a pass over the nodes, where there are colours and a texture.
bool knows_texture(const vdtree::VertexTree& tree);

// Whether a tree comes from there. What files say is looked at when a criterion is made.
bool has_fold_measurement(const vdtree::VertexTree& tree);

// The numbers that a measurement goes by. Criteria refuse trees that were measured by others.
std::span<const float> measurement_settings() noexcept;

} // namespace unseen::perception
