// repair: makes a soup consistently oriented, without cracks and small holes, before a tree is built of it.
//
// Uses CGAL's packages Surface_mesh and Polygon_mesh_processing (orientation, repair, hole filling). They are under the
// GPL, version 3 or later, or a commercial licence of GeometryFactory: a program that links this library and is passed on
// is bound by one of the two. Unseen's own code is under its own licence here, too.
#pragma once

#include <unseen/vdtree/mesh.h>
#include <unseen/vdtree/result.h>

namespace unseen::repair {

struct Options {
    // Vertices of borders up to so far apart become one position: a share of the diagonal of the mesh's box, 0..0.01.
    // The default is what is lost where coordinates are written with six digits. 0: only equal positions.
    double gap = 1e-6;
    // Holes whose box has at most this diagonal get a cap: a share of that of the connected part that they are in, 0..1.
    // Larger ones are openings that are meant, and rims of sheets, which are as large as their part.
    double largest_hole = 0.1;
};

struct Report {
    std::uint64_t duplicates = 0;     // triangles on the positions of others, in the same direction: left out
    std::uint64_t moved_vertices = 0; // to close cracks
    std::uint64_t turned_triangles = 0;
    std::uint64_t holes = 0; // connected borders, before capping
    std::uint64_t capped_holes = 0;
    std::uint64_t cap_triangles = 0;
};

struct Repaired {
    vdtree::Mesh mesh;
    Report report;
};

// Topology is that of positions: vertices at equal positions are one, so seams of attributes are neither cracks nor
// holes, and keep their attributes.
//   orient: parts that edges connect get one orientation, that of most of their triangles; closed ones that face inward
//     are turned outward, unless they lie in another one, whose cavity they are then (CGAL's orient_polygon_soup and
//     orient_to_bound_a_volume).
//   stitch: vertices of borders nearer than the gap move to one position.
//   cap: small holes, whose edges have one triangle each, are filled with triangles between their own vertices (CGAL's triangulate_hole), which lie in the
//     ranges (materials, groups) of a triangle beside the hole.
// Triangles that use a vertex twice, and duplicates, are left out; every other triangle and vertex stays, with its
// attributes. Normals that point into the surface after their triangles have been turned are turned, too. Non-manifold
// edges stay: trees take them. Fails on what vdtree::validate() refuses, on options out of range, and where CGAL gives
// up. One thread; some 5 us a triangle, and 1 KiB.
Result<Repaired> repair(vdtree::Mesh mesh, const Options& options = {});

} // namespace unseen::repair
