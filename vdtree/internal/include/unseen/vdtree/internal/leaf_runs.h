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
        if (tree_.has_seams()) return begins_[wedge];
        return wedge < tree_.interior() ? tree_.first_leaf[wedge] : wedge - tree_.interior();
    }
    Index end(WedgeId wedge) const {
        if (tree_.has_seams()) return std::min(begins_[wedge] + sizes_[wedge], tree_.leaves());
        return wedge < tree_.interior() ? tree_.leaf_end[wedge] : wedge - tree_.interior() + 1;
    }
    // The leaf at a place of the order.
    Index leaf(Index rank) const { return leaves_.empty() ? rank : leaves_[rank]; }

private:
    TreeLinks tree_;
    std::vector<Index> begins_, sizes_; // by wedge
    std::vector<Index> leaves_;         // by rank
};

} // namespace unseen::vdtree
