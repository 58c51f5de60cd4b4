// Where parts of a surface touch or pass through each other without sharing a vertex.
#pragma once

#include <vector>

#include <vdtree/vertex_tree.h>

namespace unseen::vdtree {

// By interior node: how near (mesh units) any triangle that touches its support, or the supports below, is to one that is no neighbour of it or
// of its neighbours; 0 where they intersect. Infinite where none is near, as triangles go: nearer than a quarter of the circle around the first.
// In parallel; some microseconds a triangle.
std::vector<float> find_contacts(const VertexTree& tree);

} // namespace unseen::vdtree
