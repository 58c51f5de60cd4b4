// The directions that the surroundings of each node face, before and after it folds.
#pragma once

#include "build/bound_spheres.h"
#include "build/parallel_array.h"
#include "tree/directions.h"

namespace unseen::vdtree {

// By interior node. The normals of all triangles at the corners of the ring's triangles (the ring dilated by one more
// ring), and those of the triangles around the node after its fold, the other clusters standing as they did when the
// clusterer made it; and the same of all nodes below. Nothing for nodes whose leaves are at one point: when they fold
// nothing moves.
//
// Marked where the ring has an irregular edge; `irregular`: by place, whether one ends there.
ParallelArray<Directions> bound_facing(const BoundInput& input, std::span<const Triangle> triangles,
                                       std::span<const std::uint8_t> irregular, std::span<const Sphere> support,
                                       const Ancestors& ancestors);

} // namespace unseen::vdtree
