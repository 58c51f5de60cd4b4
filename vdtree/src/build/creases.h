// Normals by corner: the mesh's own, and computed ones that hard edges part.
#pragma once

#include <optional>
#include <vector>

#include <unseen/vdtree/mesh.h>
#include <unseen/vdtree/result.h>

#include "build/surface.h"

namespace unseen::vdtree {

struct CornerInput {
    std::span<const glm::dvec3> positions; // by place
    std::span<const Triangle> triangles;   // over places, each with three different ones
    const Surface& surface;                // of these; its normals are those of smooth places
    std::span<const glm::vec3> own = {};   // by corner, 3 a triangle; zero or non-finite: computed. Empty: all are
    std::span<const Index> smoothing = {}; // by triangle, see MeshView::smoothing; empty: not stated
    std::optional<float> crease = {};      // degrees, see BuildOptions::crease
    float own_sign = 1;                    // -1: turns the mesh's own around
};

struct CornerNormals {
    // By corner, 3 a triangle: the number of its normal. Places that triangles use have consecutive numbers in their
    // own order, so a number belongs to one place; where has_creases is false and every place is used, numbers are
    // places.
    std::vector<Index> number;
    std::vector<glm::vec3> normals; // by number; unit length, or zero where there is no area
    bool has_creases = false;       // some place has more than one normal
    Creases creases;                // how they were found
    std::uint64_t compared = 0;     // pairs of normals; the work done, for tests
};

// Finds the normal of every corner.
//
// A corner's own normal is kept. Any other is the area-weighted mean of the faces around the place that share a normal
// with the corner's face. Any two faces that meet at an edge share if the angle between them is at most the crease
// angle. All faces around a place share if each is within half that angle of their mean. Smoothing groups, where
// stated, decide in place of the angle. Faces without an area join their neighbours'. Normals of a place that are
// nearly the same become one.
//
// Cost: linear but for sorting the corners of places with hard edges; parallel. The result does not depend on the
// number of threads.
CornerNormals find_corner_normals(const CornerInput& input);

// Fails if an angle is asked for that is not one from 0 to 180 degrees.
Result<void> check_crease(const std::optional<float>& degrees);

} // namespace unseen::vdtree
