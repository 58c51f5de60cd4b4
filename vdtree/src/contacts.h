// Where parts of a surface touch or pass through each other without sharing a vertex.
#pragma once

#include <vector>

#include <vdtree/vertex_tree.h>

namespace unseen::vdtree {

// By triangle: the distance (mesh units) to the nearest triangle that is no neighbour of it or of its neighbours; 0 where they intersect.
// Infinite where none is near, as triangles go: nearer than a quarter of the circle around this one. In parallel; some microseconds each.
std::vector<float> find_contacts(const VertexTree& tree);

} // namespace unseen::vdtree
