// Proxy luminances that conserve each ring's radiated light; remainders go to the parent.
#pragma once

#include <unseen/vdtree/result.h>

namespace unseen::vdtree {

class VertexTree;

// Returns the tree with other luminances of its proxies. The builder gives a proxy the mean luminance of its leaves, but
// then a fold loses light wherever the surface curves, and over many folds that becomes visible. A patch of surface
// radiates in a direction the sum over its triangles of luminance times vector area, times that direction.
//
// Nodes fold in the order of their support's radius. Each proxy gets the luminance with which its ring radiates as much as
// before the fold, as nearly as ring_luminance() allows; the parent must conserve the remainder. Leaves keep their
// luminance, and so do proxies whose leaves coincide, or whose ring faces so many ways that their luminance has no sure
// effect.
//
// support_luminance() changes accordingly. ring_luminance() and adaptation_luminance() stay, because no proxy leaves its
// ring's range. The geometry is shared. Attributes are dropped, because they belong to the old luminances: conserve first,
// then measure. Doing it again changes nothing; relit() and untextured() start from the means.
//
// Fails if check() fails, and on trees with a texture, whose light is not that of their vertices alone. Cost: folding the
// mesh once, one node after the other.
Result<VertexTree> conserve_light(const VertexTree& tree);

} // namespace unseen::vdtree
