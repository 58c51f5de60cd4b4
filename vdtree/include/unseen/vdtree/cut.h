// A cut: one view's current simplification of a vertex tree.
//
// A cut divides the interior nodes into unfolded ones (closed upward: a parent of an unfolded node is unfolded) and
// folded ones. Its active vertices, the proxies of the topmost folded nodes and the leaves that no folded
// node supports, form an antichain that covers every leaf. A triangle is active iff the node at which it vanishes is
// unfolded.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/distance_criterion.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

class CutState;

struct AdjustOptions {
    VisibilityTest visibility = {};            // default: everything can be seen
    std::optional<Index> triangle_budget = {}; // best effort: at most so many triangles
};

struct AdjustStats {
    std::uint64_t node_tests = 0; // fold costs asked for
    std::uint64_t folds = 0;      // nodes that went from unfolded to folded, and the reverse
    std::uint64_t unfolds = 0;
    Index triangles = 0;
    // The largest cost among the folded nodes that can be seen; 0 without folds. With hysteresis, and without a budget:
    // not more than this. Infinite where a time limit has left it unknown.
    float max_fold_cost = 0;
    bool is_complete = true; // false: the time limit has left something to do
};

struct FollowOptions {
    // Nodes unfold where their cost is above this. 1: nobody sees a fold; 2: nobody would from twice the distance.
    // Not used with a triangle budget.
    float threshold = 1;

    // Best effort: at most so many triangles. Unfolds in descending cost, ties by node number, down to cost 0.
    std::optional<Index> triangle_budget = {};
    bool fill_budget = false; // go on at cost 0 while triangles are left
    // 1: the best cut within the budget, always: its largest fold cost is the least. More, up to 2: the largest fold
    // cost may exceed the least by this factor; then a frame costs what changes, and slow motions do not flicker.
    float hysteresis = 1;

    // At most so long, as near as the clock and a step of some tests or changes allow (a step of each is always done);
    // what is left to do is kept for the next calls, worst folds first. Results then depend on the machine's speed. The
    // clock does not divide: the change of the whole cut after a jump, and in the call after it, finding what is to be
    // watched. A budget without hysteresis starts anew in every call.
    std::optional<double> milliseconds = {};

    // Nodes whose ring faces away fold at no cost. Only for surfaces that are closed and consistently oriented (inside
    // out or not: the tree knows), drawn with back faces culled, and seen from outside.
    bool cull_back_faces = false;
};

// One step of what changed a cut.
struct FoldChange {
    NodeId node = 0;
    bool folded = false;
};

// One index that changed.
struct IndexWrite {
    Index place = 0;
    NodeId value = 0;
};

// Not thread-safe; several cuts over one tree may be used from several threads.
class Cut {
public:
    // Starts wholly folded: no triangle. Keeps a handle of its own to the tree's data, which tree() returns: the tree
    // given may go or move.
    explicit Cut(const VertexTree& tree);
    Cut(Cut&&) noexcept;
    Cut& operator=(Cut&&) noexcept;
    ~Cut();

    const VertexTree& tree() const noexcept { return *tree_; }
    bool is_unfolded(NodeId node) const noexcept;
    bool is_active(NodeId node) const noexcept; // its proxy (or leaf) is a vertex of the simplification
    NodeId proxy_of_leaf(Index leaf) const noexcept { return proxies_[leaf]; }

    // One fold or unfold; each returns whether anything changed.
    bool unfold(NodeId node);           // precondition: interior and active
    bool fold(NodeId node);             // precondition: interior, unfolded, all its interior children folded
    bool unfold_ancestors(NodeId node); // makes the node active: unfolds everything above it
    bool fold_subtree(NodeId node);     // folds the node and everything under it
    void unfold_all();
    void fold_all();

    // Makes the cut that the criterion asks for; the result does not depend on the state before.
    //   Without a budget: fold where cost <= 1, top-down, so a node under a folded one is folded.
    //   With a budget: unfold in descending cost, ties by node number, while the triangles stay within the budget
    //   and the cost is above 0; among all cuts within the budget this one has the least largest cost.
    AdjustStats adjust(const FoldCriterion& criterion, const AdjustOptions& options = {});

    // Makes the cut that a criterion in distance form asks for, from where the last call left it: unfolds where the
    // cost is above the threshold, top-down. The result does not depend on the state before; the cost does: it goes
    // with what changes, and a view that stands still costs nothing. Another criterion, or a jump of the viewpoint,
    // tests every node in use once. Fails, and changes nothing, where
    //   the criterion was made for a tree of another number of interior nodes,
    //   the eye is not finite, or more than 1e18 mesh units from the tree's origin,
    //   the gaze or a plane's normal is not of unit length (within a thousandth), or a plane's offset not finite,
    //   an occluder is not finite or around the eye, or there are some and the criterion is of support spheres,
    //   the criterion is of lights, and these are not valid (see validate()),
    //   an option is out of its range.
    Result<AdjustStats> follow(const DistanceCriterion& criterion, const Viewpoint& viewpoint,
                               const FollowOptions& options = {});

    // What the last adjust() or follow() changed, in order: nodes are active when their turn comes.
    std::span<const FoldChange> changes() const noexcept;

    // The simplification: triangles over node numbers (positions()[index] is the vertex), oriented like the
    // input, no index twice in one triangle. Valid until the cut changes. Cost: what changed, or the active triangles
    // if much did. The order of the triangles follows from the history of the cut.
    std::span<const NodeId> indices() const;
    // What the last follow() changed of the index buffer that was current before it, for copies of it: writes in order
    // (a place may come twice, or lie beyond the end by now). None: take the whole buffer.
    std::optional<std::span<const IndexWrite>> index_writes() const noexcept;
    // Names what indices() returned last: another number after every change of it, and for every cut; 0 before. Writes
    // lead from the version `index_writes_from()` to this one.
    std::uint64_t index_version() const noexcept;
    std::uint64_t index_writes_from() const noexcept;
    Index triangle_count() const noexcept;

    std::uint64_t byte_size() const noexcept; // of the cut itself, with its index buffer; resident bytes

private:
    friend class CutState;

    std::unique_ptr<CutState> state_;
    const VertexTree* tree_; // of the state, like the following, whose places moves of the cut do not change
    const NodeId* proxies_;  // by leaf: the active node that stands for it
};

// One object of a scene that shares a budget.
struct SceneObject {
    // Refers to the cut and the criterion, which must outlive it.
    SceneObject(Cut& cut_, const DistanceCriterion& criterion_, Viewpoint viewpoint_, bool cull_back_faces_ = false)
        : cut(cut_), criterion(criterion_), viewpoint(std::move(viewpoint_)), cull_back_faces(cull_back_faces_) {}
    SceneObject(Cut& cut, DistanceCriterion&& criterion, Viewpoint viewpoint, bool cull_back_faces = false) = delete;

    Cut& cut;
    const DistanceCriterion& criterion;
    Viewpoint viewpoint; // in the object's own frame
    bool cull_back_faces = false;
};

// Makes the cuts of several objects the best within one number of triangles: unfolds in descending cost over all of
// them, ties by the earlier object and then by node number, down to cost 0. Returns one entry an object; max_fold_cost
// is the scene's. Fails, and changes nothing, where Cut::follow() would, or a cut is named twice.
Result<std::vector<AdjustStats>> follow_scene(std::span<const SceneObject> objects, Index triangle_budget);

// Which interior nodes the criterion unfolds from a viewpoint, each tested by itself, whatever is above it: one bit a
// node, the first node's lowest. Of the options, the threshold and back faces count. Fails where Cut::follow() does.
// What it says of damaged nodes (see VertexTree::is_sound) means nothing. Cost: some ten nanoseconds a node.
Result<std::vector<std::uint64_t>> test_every_node(const VertexTree& tree, const DistanceCriterion& criterion,
                                                   const Viewpoint& viewpoint, const FollowOptions& options = {});
// What folding costs, by interior node: the threshold from which on the node folds; 0 where nothing of it shows,
// infinite where it shows from everywhere. Fails and costs as the above.
Result<std::vector<float>> find_every_cost(const VertexTree& tree, const DistanceCriterion& criterion,
                                           const Viewpoint& viewpoint, const FollowOptions& options = {});

// The cut as a mesh of its own: only the vertices in use, in double precision, with the tree's attributes.
Mesh extract_mesh(const Cut& cut);

// The same, with the tree's node of each vertex, and the input's number of each triangle; the latter where the tree has
// ranges.
struct ExtractedMesh {
    Mesh mesh;
    std::vector<NodeId> nodes;
    std::vector<Index> source_triangles; // ascending
};
ExtractedMesh extract_with_sources(const Cut& cut);

} // namespace unseen::vdtree
