// How far the surface moves when nodes fold.
#pragma once

#include "build/bound_spheres.h"

namespace unseen::vdtree {

// By interior node, and never less than a child's. The planes at hand are those of the triangles around the supported
// places, and planes that stand on irregular edges there. If all their normals lie within an angle of one direction, the
// value is the proxy's largest distance from the planes, divided by the angle's cosine. So sliding within all planes costs
// nothing. From the tip of an irregular edge any way counts.
// The value is never more than the largest distance of a supported place from the proxy, and just that where there is no
// such angle.
//
// Seen along that direction the surface under the node is a height field, before and after the fold. No height changes by
// more, unless a triangle is turned over. `irregular`: by place, whether an irregular edge ends there.
std::vector<float> bound_displacements(const BoundInput& input, std::span<const Triangle> triangles,
                                       std::span<const std::uint8_t> irregular, std::span<const Sphere> support);

} // namespace unseen::vdtree
