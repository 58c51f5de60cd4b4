// A part's first clusters: one for each place, with the quadrics of the triangles and edges around it.
#pragma once

#include "build/quadric_contraction.h"

namespace unseen::vdtree {

// Pairs, outer edges and border leaves are complete, nothing is contracted.
Contraction set_up(const PartMesh& part);

} // namespace unseen::vdtree
