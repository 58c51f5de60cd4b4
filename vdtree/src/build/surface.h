// What the builder finds out about the surface before it clusters anything.
#pragma once

#include <unseen/vdtree/mesh.h>

#include "build/parallel_array.h"

namespace unseen::vdtree {

// By vertex: the lowest-numbered vertex at exactly the same position.
std::vector<Index> find_coincident(std::span<const glm::dvec3> positions);

// Corners by place, ascending. Corner k of triangle t has the number 3 t + k.
class CornersByPlace {
public:
    CornersByPlace() = default;
    CornersByPlace(std::span<const Triangle> triangles, std::size_t places);

    std::span<const Index> at(std::size_t place) const {
        return std::span<const Index>(corners_).subspan(start_[place], start_[place + 1] - start_[place]);
    }

private:
    std::vector<Index> start_; // by place, one longer
    ParallelArray<Index> corners_;
};

// A triangle's normal, as long as twice its area, and that length.
struct FaceVector {
    glm::dvec3 vector;
    double length;
};

// Over places: no two vertices coincide.
struct Surface {
    Closedness closedness = Closedness::open;
    // By vertex: whether it is at a boundary, non-manifold or inconsistently oriented edge.
    std::vector<std::uint8_t> irregular;
    // By vertex: a third of the area of the triangles around.
    std::vector<double> areas;
    // By vertex: the area-weighted mean of the normals of the faces around it; unit length, or zero where there is no
    // face with an area. Turned outward on an inside-out surface.
    std::vector<glm::vec3> normals;
    // From what all this was found: 44 bytes a triangle.
    CornersByPlace corners;
    ParallelArray<FaceVector> faces;
};

// Cost: linear.
Surface analyse_surface(const MeshView& mesh);

// Whether the mesh's own normals face as its faces do, on the whole.
bool own_normals_agree(const MeshView& mesh);

} // namespace unseen::vdtree
