#include <unseen/vdtree/internal/leaf_runs.h>

namespace unseen::vdtree {

LeafRuns::LeafRuns(const TreeLinks& tree) : tree_(tree) {
    if (tree.first_wedge.empty()) return;
    const WedgeId wedges = static_cast<WedgeId>(tree.wedge_ranks.size()), first = tree.wedge_of_leaf(0);
    sizes_.assign(wedges, 0);
    leaves_.resize(tree.leaves());
    for (Index leaf = 0; leaf < tree.leaves(); ++leaf) {
        sizes_[first + leaf] = 1;
        leaves_[tree.wedge_ranks[first + leaf]] = leaf;
    }
    for (NodeId node = static_cast<NodeId>(tree.parents.size()); node-- > 1;) // children before parents
        for (WedgeId w = tree.first_wedge[node]; w < tree.first_wedge[node + 1]; ++w)
            sizes_[tree.wedge_above(tree.parents[node], w)] += sizes_[w];
}

} // namespace unseen::vdtree
