// Proxy luminances that conserve each ring's radiated light; remainders go to the parent.
#pragma once

#include <unseen/vdtree/result.h>

namespace unseen::vdtree {

class VertexTree;

// Returns the tree with other luminances of its proxies. The builder gives a proxy the mean luminance of its leaves, but
// then a fold loses light wherever the surface curves, which many folds make visible. A patch of surface radiates in a
// direction the sum over its triangles of luminance times vector area, times that direction.
//
// Nodes fold in the order of their support's radius. Each proxy gets the luminance with which its ring radiates as much as
// before the fold, as nearly as ring_luminance() allows; the parent must conserve the remainder. Where several wedges meet,
// each stays within what its own triangles show, so that flat faces stay even. Proxies keep theirs if their leaves
// coincide, or their ring faces too many ways.
//
// support_luminance() changes accordingly; ring_luminance() and adaptation_luminance() stay. The geometry is shared, and
// attributes are dropped: conserve first, then measure. Doing it again changes nothing. Fails if check() fails, and on
// trees with a texture. Cost: folding the mesh once, one node after the other.
Result<VertexTree> conserve_light(const VertexTree& tree);

} // namespace unseen::vdtree
