#include <unseen/vdtree/internal/leaf_runs.h>

namespace unseen::vdtree {

LeafRuns::LeafRuns(const TreeLinks& tree) : tree_(tree) {
    if (!tree.has_seams()) return;
    const WedgeId first = tree.wedge_of_leaf(0), wedges = first + tree.leaves();
    begins_.resize(wedges);
    sizes_.assign(wedges, 0);
    leaves_.resize(tree.leaves());
    for (Index leaf = 0; leaf < tree.leaves(); ++leaf) {
        sizes_[first + leaf] = 1;
        leaves_[tree.leaf_ranks[leaf]] = leaf;
    }
    for (WedgeId w = 0; w < wedges; ++w) begins_[w] = tree.rank_of(w);
    for (NodeId node = static_cast<NodeId>(tree.parents.size()); node-- > 1;) // children before parents
        for (WedgeId w = tree.first_wedge_of(node); w < tree.first_wedge_of(node + 1); ++w)
            sizes_[tree.wedge_above(tree.parents[node], w)] += sizes_[w];
}

} // namespace unseen::vdtree
