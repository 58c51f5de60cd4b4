// A tree's geometry in other units, for measurements that multiply lengths.
#pragma once

#include <memory>

#include <unseen/vdtree/internal/vertex_tree_data.h>

namespace unseen::vdtree {

// A power of two that brings a radius to between 1 and 2. 1 for 0 and non-finite radii, and for ordinary ones, whose sixth
// powers neither over- nor underflow. Lengths times it and back are exact.
float unit_scale(float radius);

// Positions and spheres times a power of two, relative to the origin. All else is viewed in the given geometry, which
// it keeps alive; displacements are as they were.
std::shared_ptr<const TreeGeometry> scaled_geometry(const std::shared_ptr<const TreeGeometry>& given, float scale);

} // namespace unseen::vdtree
