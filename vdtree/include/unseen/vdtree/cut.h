// A cut: one view's current simplification of a vertex tree.
//
// A cut divides the interior nodes into unfolded and folded ones; the parent of an unfolded node is unfolded. Its active
// nodes are the topmost folded ones, and the places that no folded node supports: they form an antichain that covers every
// leaf, and their wedges are the vertices of the simplification. A triangle is active iff the node at which it vanishes is
// unfolded.
#pragma once

#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

class CutState;

struct AdjustStats {
    std::uint64_t node_tests = 0; // fold costs computed
    std::uint64_t folds = 0;      // nodes that became folded
    std::uint64_t unfolds = 0;    // nodes that became unfolded
    Index triangles = 0;
    // The largest cost of a visible folded node; 0 without folds. An upper bound with hysteresis, and without a budget.
    // Infinite if the time limit has left it unknown.
    float max_fold_cost = 0;
    bool is_complete = true; // false: the time limit has left work for later calls
};

struct FollowOptions {
    // Nodes with a cost above this unfold. At 1 nobody sees a fold; at 2 nobody would from twice the distance. Ignored
    // with a triangle budget.
    float threshold = 1;

    // The largest number of triangles. Nodes unfold in descending cost, ties by node number, down to cost 0.
    std::optional<Index> triangle_budget = {};
    bool fill_budget = false; // go on at cost 0 while triangles are left
    // 1 gives the best cut within the budget in every frame, whose largest fold cost is the least possible. Up to 2, it may
    // exceed the least by this factor; then a frame costs what changes, and slow motions do not flicker.
    float hysteresis = 1;

    // Time limit, as close as the clock allows; a few tests and changes are always done, and the rest is kept for the next
    // calls, worst folds first. Two steps cannot be interrupted: replacing the whole cut after a jump, and rebuilding the
    // watch list in the next call. A budget without hysteresis starts anew in every call.
    std::optional<double> milliseconds = {};

    // Nodes whose ring faces away fold at no cost. Only for surfaces that are closed and consistently oriented (outward
    // or inward), drawn with back faces culled, and seen from outside.
    bool cull_back_faces = false;
};

// One fold or unfold.
struct FoldChange {
    NodeId node = 0;
    bool folded = false;
};

// Used from one thread at a time. Several cuts over one tree may be used from several threads.
class Cut {
public:
    // Starts folded, without triangles. Keeps its own handle to the tree's data, which tree() returns.
    explicit Cut(const VertexTree& tree);
    Cut(Cut&&) noexcept;
    Cut& operator=(Cut&&) noexcept;
    ~Cut();

    const VertexTree& tree() const noexcept { return *tree_; }
    bool is_unfolded(NodeId node) const noexcept;
    bool is_active(NodeId node) const noexcept; // its wedges are vertices of the simplification
    NodeId proxy_of_leaf(Index leaf) const noexcept { return proxies_[leaf]; } // the active node above it
    WedgeId wedge_of_leaf(Index leaf) const noexcept { return tree_->wedge_at(proxies_[leaf], leaf); }

    // Changes by hand; each returns whether anything changed.
    bool unfold(NodeId node);           // precondition: interior and active
    bool fold(NodeId node);             // precondition: interior, unfolded, all its interior children folded
    bool unfold_ancestors(NodeId node); // makes the node active
    bool fold_subtree(NodeId node);     // folds the node and everything below it
    void unfold_all();
    void fold_all();
    // Whether the criterion wants the node unfolded. The functions below also unfold what these nodes need: below one in a
    // hundred more, or up to one in twenty of textured models. So no triangle faces away from where it faced in the mesh,
    // and none is mirrored in the texture. What is unfolded depends on what is wanted alone. After changes by hand, what is
    // unfolded counts as wanted.
    bool is_wanted(NodeId node) const noexcept;

    // Makes the criterion's cut, whatever the state before.
    //   Without a budget, nodes of cost 1 and less fold, top-down: a node below a folded one is folded.
    //   With a budget, nodes unfold in descending cost, ties by node number, while the triangles stay within the budget
    //   and the cost is above 0. Among all cuts within the budget, this one has the least largest cost.
    AdjustStats adjust(const FoldCriterion& criterion, std::optional<Index> triangle_budget = {});

    // Makes the cut of a criterion in distance form: nodes with a cost above the threshold unfold, top-down. The result
    // does not depend on the state before, but the time goes with what changes: another criterion, or a jump of the
    // viewpoint, tests every node in use once. Fails, and changes nothing, if
    //   the criterion was made for a tree with another number of interior nodes,
    //   the eye is not finite, or more than 1e18 mesh units from the tree's origin,
    //   the gaze or a plane's normal is not of unit length (within a thousandth), or a plane's offset is not finite,
    //   an occluder is not finite or contains the eye, or is used with a criterion of support spheres,
    //   the criterion is for lights and the viewpoint's lighting is invalid (see validate()),
    //   an option is out of range.
    Result<AdjustStats> follow(const DistanceCriterion& criterion, const Viewpoint& viewpoint,
                               const FollowOptions& options = {});

    // The changes of the last adjust() or follow(), in order: each node is active when its turn comes. They lead from the
    // revision changes_from() to revision(); every change makes a new one, and no two cuts share one. A copy of the cut as of
    // another revision than changes_from() has missed something, as all copies have after changes by hand.
    std::span<const FoldChange> changes() const noexcept;
    std::uint64_t revision() const noexcept;
    std::uint64_t changes_from() const noexcept;

    // The simplification: triangles over wedges (positions()[index] is the vertex), oriented like the input, of three
    // different nodes each. Valid until the cut changes. The order of the triangles depends on the cut's history.
    // Made when it is asked for. Cost: what changed since it was last asked for, or the active triangles if much did. For
    // drawing with a GPU, ActiveTriangles costs less.
    std::span<const WedgeId> indices() const;
    Index triangle_count() const noexcept;

    std::uint64_t byte_size() const noexcept; // resident bytes of the cut and its index buffer, without the tree

private:
    friend class CutState;

    std::unique_ptr<CutState> state_;
    const VertexTree* tree_; // lies in the state, so it stays in place when the cut moves
    const NodeId* proxies_;  // by leaf: the active node that stands for it; lies in the state, too
};

// One object of a scene whose objects share a budget.
struct SceneObject {
    Cut& cut;
    DistanceCriterion criterion;
    Viewpoint viewpoint; // in the object's own frame
    bool cull_back_faces = false;
};

// Makes the best cuts of several objects within one triangle budget: unfolds in descending cost, ties by object and then by
// node number, down to cost 0. One entry an object; max_fold_cost is the scene's. Fails, and changes nothing, if
// Cut::follow() would fail, or if a cut occurs twice.
Result<std::vector<AdjustStats>> follow_scene(std::span<const SceneObject> objects, Index triangle_budget);

// The interior nodes that the criterion unfolds, each tested by itself, whatever is above it: one bit a node, lowest first.
// Uses the threshold and back faces of the options only. Fails like Cut::follow(). Bits of damaged nodes (see
// VertexTree::is_sound) are meaningless. Cost: some ten nanoseconds a node.
Result<std::vector<std::uint64_t>> test_every_node(const VertexTree& tree, const DistanceCriterion& criterion,
                                                   const Viewpoint& viewpoint, const FollowOptions& options = {});
// Fold costs by interior node: the threshold from which on the node folds. 0 for invisible nodes; infinite if the fold is
// visible from everywhere. Fails and costs like test_every_node().
Result<std::vector<float>> find_every_cost(const VertexTree& tree, const DistanceCriterion& criterion,
                                           const Viewpoint& viewpoint, const FollowOptions& options = {});

// The cut as a mesh: only the vertices in use, in double precision, with their normals, colours and UVs.
Mesh extract_mesh(const Cut& cut);

// The same, with the sources of vertices and triangles.
struct ExtractedMesh {
    Mesh mesh;
    std::vector<WedgeId> wedges;         // by vertex: the tree's
    std::vector<Index> source_triangles; // by triangle: its number in the input, ascending; empty without ranges
};
ExtractedMesh extract_with_sources(const Cut& cut);

} // namespace unseen::vdtree
