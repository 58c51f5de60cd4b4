// exact: checks a tree's bounds in exact arithmetic.
//
// Uses CGAL's number types, which are under the LGPL, version 3 or later, and none of its packages under the GPL.
#pragma once

#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::exact {

struct Verification {
    std::uint64_t comparisons = 0;  // of bounds with what they contain
    std::uint64_t in_rationals = 0; // those of them that doubles with their error bounds could not decide
};

// Checks in rational numbers, without slack, what vdtree::verify() checks in doubles with a slack of 1e-14:
//   Each support sphere contains the proxy, the leaves and its children's spheres. Each ring sphere contains the proxy, its
//   children's spheres, and the corners of all triangles at its leaves. The bounding sphere contains all corners.
//   No plane of these triangles is farther from the proxy than the displacement, in nodes of up to 4096 leaves.
//   Slabs contain the normals of these triangles; masks have a cell within 1e-5 of each, which vdtree::facing() allows for.
// verify() already checks all other promises exactly, because they compare stored numbers; call it first. The error names
// the first offender. Cost: leaves times depth, some 20 ns each; a microsecond for each comparison in rationals.
Result<Verification> verify_exactly(const vdtree::VertexTree& tree, const Progress& progress = {});

} // namespace unseen::exact
