// Which leaves each wedge holds.
#pragma once

#include <algorithm>

#include <unseen/vdtree/internal/tree_shape.h>

namespace unseen::vdtree {

// In the depth-first order of the forest every wedge holds a run of leaves. Where every node has one wedge, that is the
// order of the leaves. The links must stay where they are. Cost: one pass over the wedges of a tree with seams.
class LeafRuns {
public:
    explicit LeafRuns(const TreeLinks& tree);

    Index begin(WedgeId wedge) const {
        if (!tree_.first_wedge.empty()) return tree_.wedge_ranks[wedge];
        return wedge < tree_.interior() ? tree_.first_leaf[wedge] : wedge - tree_.interior();
    }
    Index end(WedgeId wedge) const {
        if (!tree_.first_wedge.empty()) return std::min(tree_.wedge_ranks[wedge] + sizes_[wedge], tree_.leaves());
        return wedge < tree_.interior() ? tree_.leaf_end[wedge] : wedge - tree_.interior() + 1;
    }
    // The leaf at a place of the order.
    Index leaf(Index rank) const { return leaves_.empty() ? rank : leaves_[rank]; }

private:
    TreeLinks tree_;
    std::vector<Index> sizes_, leaves_; // by wedge; by rank
};

} // namespace unseen::vdtree
