// The best cuts of one or more trees within a number of triangles.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <unseen/vdtree/function_ref.h>

#include "cut/cost_source.h"

namespace unseen::vdtree {

struct BudgetLimits {
    std::uint64_t triangles = std::numeric_limits<std::uint64_t>::max(); // of all trees together
    bool fill = false;                                                   // also unfold nodes of cost 0
    bool only_unfolding = false;          // leave nodes folded that their source does not unfold
    Callback<bool()> is_out_of_time = {}; // asked between batches
};

struct BudgetDecision {
    std::vector<std::vector<std::uint64_t>> unfolded; // by tree, one bit an interior node
    bool is_complete = true;                          // false: the time ended it
    std::uint64_t node_tests = 0;
    float threshold = 0;     // the largest cost among the nodes left folded
    float max_seen_cost = 0; // the largest seen cost among them
};

// Unfolds in descending cost, ties by the lower tree and then by the lower node, while the triangles of all trees
// together stay within the budget; the first node that does not fit ends it, for taking a cheaper one instead would
// leave the largest cost as it is. A node counts as at most its parent. Nodes of cost 0 stay folded unless the limits
// say so. Cost: one test for each node unfolded, and its children, and half as many more. Most of them tell no more
// than whether a node unfolds at a threshold that is guessed from a sample, or what it costs at most; the costs of
// outlines are asked for near the budget's end only. Where the guess does not help (too little is left of the budget at
// it, time is limited, or nodes do not nest), all costs, from the root down.
BudgetDecision decide_budget(std::span<const VertexTree* const> trees, std::span<const CostSource* const> sources,
                             const BudgetLimits& limits);

} // namespace unseen::vdtree
