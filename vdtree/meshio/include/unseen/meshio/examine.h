// What is unusual about a triangle soup, counted: holes, non-manifold and inconsistent edges, duplicates, parts that
// are inside out.
#pragma once

#include <unseen/vdtree/mesh.h>
#include <unseen/vdtree/result.h>

namespace unseen::meshio {

// Vertices at equal positions are one "place". Edges connect places, so seams of texture coordinates are no holes.
// Triangles that use a place twice have no edges. Of vertices, only those that triangles use are counted, but for
// unreferenced ones.
struct Examination {
    std::uint64_t unreferenced_vertices = 0;
    std::uint64_t coincident_vertices = 0; // at the place of one before
    std::uint64_t duplicate_vertices = 0;  // the same with equal normals, colours and texture coordinates: needless
    bool is_unwelded = false;              // see below

    std::uint64_t degenerate_triangles = 0; // of zero area, up to rounding
    std::uint64_t duplicate_triangles = 0;  // on the three places of one before, in any order

    std::uint64_t boundary_edges = 0;        // of one triangle
    std::uint64_t boundary_loops = 0;        // connected boundary edges; loops that touch count as one
    std::uint64_t non_manifold_edges = 0;    // of more than two triangles
    std::uint64_t inconsistent_edges = 0;    // of two triangles that run it in the same direction
    std::uint64_t non_manifold_vertices = 0; // places whose triangles are not all connected by edges there

    std::uint64_t components = 0;            // of triangles that edges connect
    std::uint64_t closed_components = 0;     // all of whose edges have two triangles in opposite directions
    std::uint64_t inside_out_components = 0; // closed, with a negative volume

    glm::dvec3 low = glm::dvec3(0), high = glm::dvec3(0); // the bounding box, in mesh units; 0 without triangles
};

// Time and memory are linear but for sorts of the edges at one place: some 100 bytes and 1 us a triangle. Fails on
// what vdtree::validate() refuses.
Result<Examination> examine(const vdtree::MeshView& mesh);

// Whether there are several triangles, no two share a vertex, and some vertices coincide. The mesh must be valid.
bool is_unwelded(const vdtree::MeshView& mesh);

} // namespace unseen::meshio
