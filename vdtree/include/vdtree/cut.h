// A cut: one view's current simplification of a vertex tree.
//
// A cut divides the interior nodes into unfolded ones (closed upward: a parent of an unfolded node is unfolded) and
// folded ones. Its active vertices, the proxies of the topmost folded nodes and the leaves that no folded
// node supports, form an antichain that covers every leaf. A triangle is active iff the node at which it vanishes is unfolded.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <vdtree/criteria.h>
#include <vdtree/vertex_tree.h>

namespace unseen::vdtree {

struct AdjustOptions {
    VisibilityTest visibility = {};                  // default: everything can be seen
    std::optional<Index> triangle_budget = {};       // best effort: at most so many triangles
};

struct AdjustStats {
    std::uint64_t node_tests = 0; // fold costs asked for
    std::uint64_t folds = 0;      // nodes that went from unfolded to folded, and the reverse
    std::uint64_t unfolds = 0;
    Index triangles = 0;
    float max_fold_cost = 0;      // the largest cost among the folded nodes that can be seen; 0 without folds
};

// Not thread-safe; several cuts over one tree may be used from several threads.
class Cut {
public:
    // Starts wholly folded: no triangle. The tree must outlive the cut.
    explicit Cut(const VertexTree& tree);

    const VertexTree& tree() const noexcept { return *tree_; }
    bool is_unfolded(NodeId node) const noexcept;
    bool is_active(NodeId node) const noexcept; // its proxy (or leaf) is a vertex of the simplification
    NodeId proxy_of_leaf(Index leaf) const noexcept { return proxy_[leaf]; }

    // One fold or unfold; each returns whether anything changed.
    bool unfold(NodeId node);            // precondition: interior and active
    bool fold(NodeId node);              // precondition: interior, unfolded, all its interior children folded
    bool unfold_ancestors(NodeId node);  // makes the node active: unfolds everything above it
    bool fold_subtree(NodeId node);      // folds the node and everything under it
    void unfold_all();
    void fold_all();

    // Makes the cut that the criterion asks for; the result does not depend on the state before.
    //   Without a budget: fold where cost <= 1, top-down, so a node under a folded one is folded.
    //   With a budget: unfold in descending cost, ties by node number, while the triangles stay within the budget
    //   and the cost is above 0; among all cuts within the budget this one has the least largest cost.
    AdjustStats adjust(FoldCriterion criterion, const AdjustOptions& options = {});

    // The simplification: triangles over node numbers (positions()[index] is the vertex), oriented like the
    // input, no index twice in one triangle. Valid until the cut changes. Cost: the active triangles, if it changed.
    std::span<const NodeId> indices() const;
    void render(RenderCallback callback) const { callback(*tree_, indices()); }
    Index triangle_count() const noexcept { return triangle_count_; }

private:
    void set_unfolded(NodeId node);
    void set_folded(NodeId node);
    void assign(NodeId node);

    const VertexTree* tree_;
    std::vector<std::uint64_t> unfolded_;  // one bit per interior node
    std::vector<NodeId> proxy_;            // by leaf: the active node that stands for it
    Index triangle_count_ = 0;
    mutable std::vector<NodeId> indices_;
    mutable bool indices_stale_ = true;
};

// The cut as a mesh of its own: only the vertices in use, in double precision, with the tree's attributes.
Mesh extract_mesh(const Cut& cut);

} // namespace unseen::vdtree
