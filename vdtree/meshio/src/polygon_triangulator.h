// Polygons as triangles.
#pragma once

#include <unseen/vdtree/mesh.h>

namespace unseen::meshio {

using vdtree::Index;
using vdtree::Triangle;

// Cuts polygons with n corners into n - 2 triangles that keep the polygon's orientation. Convex polygons become fans
// from their first corner; concave ones are cut by ear clipping in the plane of their Newell normal, so simple ones
// keep their area. Self-intersecting and degenerate polygons get n - 2 triangles as well, with no promise of shape.
//
// Ear clipping costs up to n^3 tests, so all polygons of one file share a budget; once it is spent the remaining
// concave polygons are fanned and counted. One object for each file, used from one thread.
class PolygonTriangulator {
public:
    // The triangles as indices into `positions`; valid until the next call.
    std::span<const Triangle> cut(std::span<const glm::dvec3> positions);

    // Concave polygons that became fans because the budget was spent.
    std::uint64_t fanned_concave() const { return fanned_concave_; }

private:
    bool project(std::span<const glm::dvec3> positions);
    bool is_convex() const;
    void fan(std::span<const Index> ring);
    void clip_ears();
    bool is_ear(std::size_t at, int strictness);

    std::int64_t tests_left_ = 100'000'000; // point-in-triangle tests, less than a second
    std::uint64_t fanned_concave_ = 0;
    std::vector<glm::dvec2> points_; // projected, largest coordinate 1, counter-clockwise
    std::vector<Index> ring_;        // corners not yet cut off
    std::vector<Triangle> triangles_;
};

} // namespace unseen::meshio
