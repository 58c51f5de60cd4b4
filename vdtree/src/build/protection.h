// Places that are to be kept more than others, or never fold: see MeshView::weights.
#pragma once

#include <unseen/vdtree/builder.h>

#include "build/leaves.h"
#include "build/order_nodes.h"
#include "build/surface.h"

namespace unseen::vdtree {

inline bool may_fold(float weight) { return weight < never_folds; }

// By place: the largest weight of its vertices and of the borders that it is on. Empty: 1 for all.
std::vector<float> place_weights(const PlaceMesh& places, const MeshView& mesh, const CornersByPlace& corners,
                                 float border_weight);

// The same hierarchy without the places that never fold: these become children of a new root, beside what is left.
Clustering with_locked_apart(const Clustering& given, std::span<const float> weights);

// What the tree keeps, see TreeGeometry; `weights` by place of the mesh.
std::vector<float> fold_weights(const NodeOrder& nodes, std::span<const float> weights);
std::vector<glm::dvec3> locked_positions(const NodeOrder& nodes, std::span<const float> weights,
                                         std::span<const glm::dvec3> positions, const glm::dvec3& origin);

} // namespace unseen::vdtree
