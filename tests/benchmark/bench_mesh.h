// The mesh that the benchmarks share: the file in UNSEEN_BENCH_MESH, or a bumpy sphere of 200,000 triangles.
#pragma once

#include <unseen/vdtree/mesh.h>
#include <unseen/vdtree/vertex_tree.h>
#include <unseen/vdtree/view.h>

namespace unseen::bench {

const vdtree::Mesh& mesh();
const vdtree::VertexTree& tree();       // by the quadric clusterer, one thread
const vdtree::VertexTree& large_tree(); // of 16 times the triangles; by the octree, which is quick to build

// The model filling 90% of a 1024 x 1024 window on the default display, `degrees` around the vertical axis from +Z.
vdtree::View orbit(double degrees);
vdtree::View orbit(const vdtree::VertexTree& around, double degrees);

} // namespace unseen::bench
