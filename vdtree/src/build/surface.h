// What the builder finds out about the surface before it clusters anything.
#pragma once

#include <unseen/vdtree/mesh.h>

namespace unseen::vdtree {

// By vertex: the lowest-numbered vertex at exactly the same position.
std::vector<Index> find_coincident(std::span<const glm::dvec3> positions);

struct Surface {
    Closedness closedness = Closedness::open;
    // By vertex: whether it is at a boundary, non-manifold or inconsistently oriented edge, after welding coincident
    // vertices; triangles that the welding degenerates have no edges.
    std::vector<std::uint8_t> irregular;
    // By vertex: a third of the area of the triangles around.
    std::vector<double> areas;
    // By vertex: the mesh's own normal where it has length, else the area-weighted mean of the normals of the faces
    // around the position; unit length, or zero where there is no face with an area. Turned outward on an
    // inside-out surface.
    std::vector<glm::vec3> normals;
};

// Cost: linear, and 48 bytes a triangle while it lasts.
Surface analyse_surface(const MeshView& mesh, std::span<const Index> coincident);

} // namespace unseen::vdtree
