// exact: checks a tree's bounds in exact arithmetic.
//
// Uses CGAL's number types, which are under the LGPL, version 3 or later, and none of its packages under the GPL.
#pragma once

#include <cstdint>

#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::exact {

struct Verification {
    std::uint64_t comparisons = 0;  // of bounds with what they contain
    std::uint64_t in_rationals = 0; // those of them that doubles with their error bounds could not decide
};

// Checks in rational numbers, without any slack, what vdtree::verify() checks in doubles with a slack of 1e-14:
//   that each support sphere contains the proxy, the leaves and the spheres of its children, and each ring sphere the
//   proxy, its children's spheres, and the corners of all triangles at its leaves; the bounding sphere all corners;
//   that no leaf, of all and not of the first 4096, is farther from the proxy than the displacement;
//   that slabs contain the normals of these triangles, and masks a cell within 1e-5 of each, which is what
//   vdtree::facing() allows for.
// All other promises are comparisons of stored numbers, which verify() makes exactly; call it first. The error names
// the first offender. Cost: leaves times depth, some 20 ns each; a microsecond for each comparison in rationals.
Result<Verification> verify_exactly(const vdtree::VertexTree& tree, const Progress& progress = {});

} // namespace unseen::exact
