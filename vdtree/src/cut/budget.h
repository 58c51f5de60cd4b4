// Where the costs of folds come from, and the best cuts of one or more trees within a number of triangles.
#pragma once

#include <unseen/vdtree/function_ref.h>

#include "cut/kernel/fold_kernel.h"

namespace unseen::vdtree {

// Costs by tests in distance form (FoldTester), or by a callback of the caller's own.
class CostSource {
public:
    explicit CostSource(const VertexTree& of) : tree(of) {}
    CostSource(const CostSource&) = delete;
    CostSource& operator=(const CostSource&) = delete;
    virtual ~CostSource() = default;

    const VertexTree& tree;

    virtual void find_costs(std::span<const NodeId> nodes, const NodeCosts& costs) const = 0;

    // Whether there is more than costs: nodes known to nest, bounds of costs that are cheaper than these, and verdicts
    // at any threshold. What follows is asked for only then.
    virtual bool has_bounds() const noexcept { return false; }
    virtual bool is_monotone() const noexcept { return false; }
    // At least both costs. `folded_at`, if not null, is a threshold (somewhat more than one) at which all of the nodes
    // are folded.
    virtual void find_cost_bounds(std::span<const NodeId>, [[maybe_unused]] const float* folded_at, float*,
                                  float*) const {}
    // Whether nodes unfold at a threshold, one bit each. Only without least costs.
    virtual void decide_at([[maybe_unused]] float threshold, std::span<const NodeId>, std::uint64_t*) const {}
};

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
// together stay within the budget; the first node that does not fit ends it. A node counts as at most its parent. Nodes
// of cost 0 stay folded unless the limits say so.
//
// Cost: one test for each node unfolded, and its children, and half as many more. Most of them only tell whether a node
// unfolds at a threshold that is guessed from a sample, or what it costs at most. Where the guess does not help (too
// little is left of the budget at it, time is limited, or nodes do not nest), all costs, from the root down.
BudgetDecision decide_budget(std::span<const CostSource* const> sources, const BudgetLimits& limits);

} // namespace unseen::vdtree
