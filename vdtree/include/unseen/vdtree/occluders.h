// What a solid hides: spheres inside of it, behind which an eye outside of it sees nothing.
#pragma once

#include <vector>

#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

struct InnerSphereOptions {
    int count = 8; // at most so many, the largest; each costs a nanosecond or less in every test
    int cells =
        96; // of a grid along the tree's longest side, 8 to 512: spheres stay out of all cells that the surface touches
};

// Spheres that a closed surface encloses and nowhere touches: every line from outside to a point in one crosses the
// surface before. For Viewpoint::occluders, with the eye outside of the tree's bounding sphere. Empty for open
// surfaces, where VertexTree::check() fails, and where nothing fits in. Where surfaces intersect themselves, inside is
// where their winding number is not 0. Cost: some 0.1 s, and 50 ns a triangle; up to a dozen bytes for every cell while
// it works.
std::vector<Sphere> inner_spheres(const VertexTree& tree, const InnerSphereOptions& options = {});

} // namespace unseen::vdtree
