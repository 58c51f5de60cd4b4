// Proxy luminances that conserve each ring's radiated light; remainders go to the parent.
#pragma once

#include <unseen/vdtree/result.h>

namespace unseen::vdtree {

class VertexTree;

// The tree with other luminances of its proxies. The builder gives a proxy the mean luminance of its leaves, and a fold
// then loses light wherever the surface curves; over many folds that can be seen. Light in a direction that a patch of
// surface faces: the sum over its triangles of luminance times vector area, times that direction.
//
// Nodes are folded in the order of their support's radius. Each proxy gets the luminance with which its ring radiates
// what it did before the fold, as nearly as ring_luminance() allows; the remainder is added to what the parent is to
// conserve. Leaves keep their luminance, and so do proxies whose leaves coincide, or whose ring faces so many ways that
// their luminance has no sure effect.
//
// support_luminance() follows; ring_luminance() and adaptation_luminance() hold as they are, for no proxy leaves its
// ring's range. The geometry is shared with the given tree. Without attributes, which are of other luminances: conserve
// first, then measure. Done again it changes nothing; relit() and untextured() start from the means.
//
// Fails where check() does, and on trees with a texture, whose light is more than that of their vertices. Cost: of
// folding the mesh once, one node after the other. The result does not depend on the threads.
Result<VertexTree> conserve_light(const VertexTree& tree);

} // namespace unseen::vdtree
