// Where budgets and thresholds get the costs of folds from: tests in distance form (FoldTester), or a callback of the
// caller's own.
#pragma once

#include <cstdint>
#include <span>

#include <unseen/vdtree/vertex_tree.h>

#include "cut/kernel/fold_kernel.h"

namespace unseen::vdtree {

class CostSource {
public:
    virtual ~CostSource() = default;

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

} // namespace unseen::vdtree
