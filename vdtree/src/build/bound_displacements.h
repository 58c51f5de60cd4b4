// How far the surface moves when nodes fold.
#pragma once

#include "build/bound_spheres.h"

namespace unseen::vdtree {

// By interior node, and never less than a child's: the largest distance of the proxy from the planes of the triangles
// around the supported places, and from the planes that stand on irregular edges there, divided by the cosine of the angle
// that all these normals are within of one direction. Sliding within all planes costs nothing; from the tip of an irregular
// edge any way counts. At most the farthest that a supported place may be from the proxy, which is also the value where the
// normals are within no such angle.
//
// Seen along that direction the surface under the node is a height field, before and after the fold, and no height changes
// by more, unless a triangle is turned over. `irregular`: by place, whether an irregular edge ends there.
std::vector<float> bound_displacements(const BoundInput& input, std::span<const Triangle> triangles,
                                       std::span<const std::uint8_t> irregular, std::span<const Sphere> support);

} // namespace unseen::vdtree
