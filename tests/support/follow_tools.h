// What a cut that follows a viewpoint is compared with, from the definitions.
#pragma once

#include <algorithm>
#include <array>
#include <set>
#include <span>
#include <vector>

#include <unseen/vdtree/cut.h>

#include "cut/kernel/fold_tester.h"
#include "sound.h"
#include "tree_checks.h"

namespace unseen::support {

using namespace vdtree;

// Independent of the follower: top-down by single tests.
inline std::vector<bool> from_scratch(const VertexTree& tree, const DistanceCriterion& criterion,
                                      const Viewpoint& viewpoint, const FollowOptions& options) {
    FoldTester tester(tree, criterion, options.cull_back_faces, options.threshold);
    tester.look_from(viewpoint, 1);
    std::vector<bool> unfolded(tree.interior_count(), false);
    for (NodeId node = 0; node < tree.interior_count();) {
        const FoldCandidate candidate = tester.candidate(node);
        Verdict verdict;
        tester.test({&candidate, 1}, {&verdict, 1});
        unfolded[node] = verdict.unfolded;
        node = verdict.unfolded ? node + 1 : support::sound(tree).subtree_end()[node];
    }
    return with_needs(tree, std::move(unfolded));
}

inline std::vector<bool> state_of(const Cut& cut) {
    std::vector<bool> unfolded;
    for (NodeId node = 0; node < cut.tree().interior_count(); ++node) unfolded.push_back(cut.is_unfolded(node));
    return unfolded;
}

using Triangles = std::multiset<std::array<NodeId, 3>>;
inline Triangles triangles_of(std::span<const NodeId> indices) {
    Triangles out;
    for (std::size_t i = 0; i < indices.size(); i += 3) {
        std::array<NodeId, 3> t{indices[i], indices[i + 1], indices[i + 2]};
        std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
        out.insert(t);
    }
    return out;
}

// What the cut's definition says: triangles of unfolded nodes, by the proxies of their corners.
inline Triangles gathered(const Cut& cut) {
    const VertexTree& tree = cut.tree();
    std::vector<NodeId> indices;
    for (NodeId node = 0; node < tree.interior_count(); ++node)
        if (cut.is_unfolded(node))
            for (Index t = support::sound(tree).first_triangle()[node];
                 t < support::sound(tree).first_triangle()[node + 1]; ++t)
                for (const Index leaf : support::sound(tree).triangles()[t]) indices.push_back(cut.wedge_of_leaf(leaf));
    return triangles_of(indices);
}

} // namespace unseen::support
