#include "tree_parts.h"

#include <algorithm>

namespace unseen::vdtree {

namespace {

// Enough parts for all threads to be busy to the end, and few enough for little to cross their borders.
constexpr Index most_parts = 64;
constexpr Index least_leaves = 1024; // of a part that is worth a task

} // namespace

TreeParts part_tree(const TreeShape& shape, std::span<const Index> first_triangle, std::span<const Triangle> triangles) {
    TreeParts tree;
    const Index most_leaves = std::max(shape.leaves() / most_parts, least_leaves);
    for (NodeId node = 0; node < shape.interior();) {
        if (shape.leaf_end[node] - shape.first_leaf[node] > most_leaves) {
            tree.top.push_back(node++);
            continue;
        }
        const NodeId end = shape.subtree_end[node];
        const Index first_leaf = shape.first_leaf[node], leaf_end = shape.leaf_end[node];
        TreePart* before = tree.parts.empty() ? nullptr : &tree.parts.back();
        // Small siblings share a part, but for leaves of their parent between them.
        if (before && before->end == node && before->leaf_end == first_leaf &&
            shape.parents[before->begin] == shape.parents[node] && leaf_end - before->first_leaf <= most_leaves) {
            before->end = end;
            before->leaf_end = leaf_end;
            before->triangle_end = first_triangle[end];
        } else {
            tree.parts.push_back({node, end, first_leaf, leaf_end, first_triangle[node], first_triangle[end]});
        }
        node = end;
    }

    std::vector<std::vector<Index>> crossing(tree.parts.size());
    tbb::parallel_for(std::size_t{0}, tree.parts.size(), [&](std::size_t i) {
        const TreePart& part = tree.parts[i];
        for (Index t = part.first_triangle; t < part.triangle_end; ++t)
            if (!part.holds(triangles[t][0]) || !part.holds(triangles[t][1]) || !part.holds(triangles[t][2]))
                crossing[i].push_back(t);
    });
    for (const auto& some : crossing) tree.crossing.insert(tree.crossing.end(), some.begin(), some.end());
    for (const NodeId node : tree.top)
        for (Index t = first_triangle[node]; t < first_triangle[node + 1]; ++t) tree.crossing.push_back(t);
    return tree;
}

} // namespace unseen::vdtree
