// Measures what folding each node of a tree changes, for error_distances() in <unseen/perception/criterion.h>.
#pragma once

#include <unseen/vdtree/vertex_tree.h>

namespace unseen::perception {

// Returns the tree with the measurement as attributes (docs/file-format.md), which files keep. It holds for the tree's
// light and luminances. Folds change less if the proxies' luminances conserve light: call vdtree::conserve_light() before.
//
// Three things are compared before and after a fold:
// - small pictures of the surface, seen along the node's normal;
// - points: the children's proxies, leaves spread over the support, the leaves that were worst in the children, and
//   three points of each edge that the fold moves;
// - pictures of the whole mesh, folded in stages (not if vertices are translucent).
// Textured surfaces show the texture at their texture coordinates. Detail finer than the pictures' cells counts by how
// far the fold slides it over the surface (fold_texture). Surfaces with coordinates and no texture, or one of one colour,
// may have other images there, such as a normal map: they show noise of a usual texture's contrast.
//
// A criterion decides what the numbers mean for an eye. This is a measurement, not a bound over all cuts: neighbours may
// be folded in other ways, and there are few cells and points.
//
// Where anything has a colour (vertices or texels), red-green and yellow-violet differences are measured beside luminance, and
// what is kept is what they come to together: chroma counts as so much luminance as is seen as well, by fixed ratios.
//
// Fails if check() does. Cost: a second, and some 25 us a node, two to four times as
// much with texture coordinates; in parallel. No step is quadratic in the triangles around a vertex or in overlapping triangles.
// The result does not depend on the threads (0: all cores). Progress can cancel.
Result<vdtree::VertexTree> measure_folds(const vdtree::VertexTree& tree, int threads = 0,
                                         const Progress& progress = {});

// Whether what folds change can be measured under lights: false if the tree has a texture over vertices of several hues,
// which give one texel different luminances. Cost: a pass over the nodes of a tree with colours and a texture.
bool knows_lit_texture(const vdtree::VertexTree& tree);

// Whether a tree comes from measure_folds(). Values from files are checked when a criterion is made.
bool has_fold_measurement(const vdtree::VertexTree& tree);

// The settings of a measurement. Criteria refuse trees that were measured with other ones.
std::span<const float> measurement_settings() noexcept;

} // namespace unseen::perception
