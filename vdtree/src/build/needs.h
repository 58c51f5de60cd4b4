// Which nodes need others to be unfolded, so that no triangle turns over in any cut.
#pragma once

#include <unseen/vdtree/internal/vertex_tree_data.h>

namespace unseen::vdtree {

// For a tree with all of its geometry. Cost: a few nanoseconds for each way in which a triangle can be drawn, some fifty;
// parallel.
NeedArrays<Vector> find_needs(const TreeGeometry& geometry);

} // namespace unseen::vdtree
