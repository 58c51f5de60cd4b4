// Optimal pruning: of all cuts with so many triangles, the one whose errors add up to the least (Chou, Lookabaugh and Gray
// 1989, "Optimal pruning with applications to tree-structured source coding and modeling").
#pragma once

#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

// By interior node: the price of a triangle from which on the node is folded in the cut of least
//     sum of errors of the topmost folded nodes + price * triangles.
// `errors`: of folding each interior node, 0 or more, finite. Prices never grow from a node to its children, so the cuts
// of falling prices nest; among all cuts with as many triangles, each has the least sum. What nodes need (Cut::is_wanted())
// is not counted. Infinite where a fold removes no triangle and errs. Cost: some 100 ns a node. Fails if check() does, and
// if sizes do not fit the tree.
Result<std::vector<float>> pruning_prices(const VertexTree& tree, std::span<const float> errors);

} // namespace unseen::vdtree
