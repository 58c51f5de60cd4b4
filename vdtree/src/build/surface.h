// What the builder finds out about the surface before it clusters anything.
#pragma once

#include <unseen/vdtree/mesh.h>

namespace unseen::vdtree {

// By vertex: the lowest-numbered vertex at exactly the same position.
std::vector<Index> find_coincident(std::span<const glm::dvec3> positions);

// Over places: no two vertices coincide.
struct Surface {
    Closedness closedness = Closedness::open;
    // By vertex: whether it is at a boundary, non-manifold or inconsistently oriented edge.
    std::vector<std::uint8_t> irregular;
    // By vertex: a third of the area of the triangles around.
    std::vector<double> areas;
    // By vertex: the area-weighted mean of the normals of the faces around it; unit length, or zero where there is no face
    // with an area. Turned outward on an inside-out surface.
    std::vector<glm::vec3> normals;
};

// Cost: linear, and 48 bytes a triangle while it lasts.
Surface analyse_surface(const MeshView& mesh);

// Whether the mesh's own normals face as its faces do, on the whole.
bool own_normals_agree(const MeshView& mesh);

} // namespace unseen::vdtree
