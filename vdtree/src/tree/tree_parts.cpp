#include <unseen/vdtree/internal/tree_parts.h>

#include <algorithm>
#include <iterator>

namespace unseen::vdtree {

namespace {

// Enough parts for all threads to be busy to the end, and few enough for little to cross their borders.
constexpr Index most_parts = 64;
constexpr Index least_leaves = 1024; // of a part that is worth a task

} // namespace

TreeParts::TreeParts(const TreeLinks& tree)
    : tree_(tree), top_{0, tree.interior(), 0, tree.leaves(), 0, 0, {}}, is_top_(tree.interior(), 0) {
    const Index most_leaves = std::max(tree.leaves() / most_parts, least_leaves);
    for (NodeId node = 0; node < tree.interior();) {
        const Index first_leaf = tree.first_leaf[node], leaf_end = tree.leaf_end[node];
        if (leaf_end - first_leaf > most_leaves) {
            is_top_[node] = 1;
            top_nodes_.push_back(node++);
            continue;
        }
        const NodeId end = tree.subtree_end[node];
        TreePart* before = parts_.empty() ? nullptr : &parts_.back();
        // Small siblings share a part, but for leaves of their parent between them.
        if (before && before->end == node && before->leaf_end == first_leaf &&
            tree.parents[before->begin] == tree.parents[node] && leaf_end - before->first_leaf <= most_leaves) {
            before->end = end;
            before->leaf_end = leaf_end;
        } else {
            parts_.push_back({node, end, first_leaf, leaf_end, 0, 0, {}});
        }
        node = end;
    }
}

void TreeParts::assign_triangles(std::span<const Index> first_triangle, std::span<const Triangle> triangles) {
    parallel_loop(std::size_t{0}, parts_.size(), [&](std::size_t i) {
        TreePart& part = parts_[i];
        part.first_triangle = first_triangle[part.begin];
        part.triangle_end = first_triangle[part.end];
        const auto elsewhere = [&](Index leaf) { return !owns_leaf(part, leaf); };
        for (Index t = part.first_triangle; t < part.triangle_end; ++t)
            if (std::any_of(triangles[t].begin(), triangles[t].end(), elsewhere)) part.crossing.push_back(t);
    });
    for (TreePart& part : parts_) {
        top_.crossing.insert(top_.crossing.end(), part.crossing.begin(), part.crossing.end());
        part.crossing.clear();
    }
    for (const NodeId node : top_nodes_)
        for (Index t = first_triangle[node]; t < first_triangle[node + 1]; ++t) top_.crossing.push_back(t);
    // They belong to the parts of their corners as well, but for the part that they vanish in.
    for (const Index t : top_.crossing) {
        TreePart* seen[3] = {};
        for (std::size_t k = 0; k < 3; ++k) {
            const Index leaf = triangles[t][k];
            const auto after = std::upper_bound(parts_.begin(), parts_.end(), leaf,
                                                [](Index l, const TreePart& part) { return l < part.first_leaf; });
            if (after == parts_.begin()) continue;
            TreePart& part = *std::prev(after);
            if (!owns_leaf(part, leaf) || t - part.first_triangle < part.triangle_end - part.first_triangle) continue;
            if (&part == seen[0] || &part == seen[1]) continue;
            seen[k] = &part;
            part.crossing.push_back(t);
        }
    }
}

} // namespace unseen::vdtree
