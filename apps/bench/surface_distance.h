// How far points are from the surface of a mesh.
#pragma once

#include <vector>

#include <glm/vec3.hpp>

#include <unseen/vdtree/mesh.h>

namespace unseen::app {

// Refers to the mesh, which has triangles. Not for several threads at once.
class SurfaceDistance {
public:
    explicit SurfaceDistance(const vdtree::Mesh& mesh);

    double operator()(glm::dvec3 p) const; // mesh units

private:
    static constexpr int cells = 64; // along each side of a cubic grid; a triangle is in all that its box meets
    glm::ivec3 cell_of(glm::dvec3 p) const;
    std::size_t number_of(glm::ivec3 cell) const;

    const vdtree::Mesh& mesh_;
    glm::dvec3 low_;
    double cell_;
    std::vector<std::vector<vdtree::Index>> lists_; // of triangles
};

// The mean over vertices of the original, some 20,000 at equal steps, as a share of its largest extent; NaN if nothing is
// left.
double mean_surface_distance(const vdtree::Mesh& original, const vdtree::Mesh& simple);

} // namespace unseen::app
