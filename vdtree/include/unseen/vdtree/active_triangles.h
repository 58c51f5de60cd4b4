// A cut in the form for GPUs: the active triangles, and what stands for each leaf.
//
// The corners of a triangle are leaves. They never change; what changes with the cut is which wedge stands for a leaf. So
// the CPU sends the triangles that came, and runs of leaves for which another wedge stands now, and a compute pass makes
// the index buffer:
//
//     index[i] = wedge_of_leaf[leaf_at_corner[i]]
//
// A fold changes one run, however many corners show it. apps/samples/plain_gl.h does this in plain OpenGL.
#pragma once

#include <unseen/vdtree/cut.h>

namespace unseen::vdtree {

// Leaves that follow each other, for all of which one wedge stands.
struct LeafRun {
    Index first = 0, count = 0;
    WedgeId wedge = 0;
};

// Keeps a handle to the tree's data. Not synchronised.
class ActiveTriangles {
public:
    explicit ActiveTriangles(const VertexTree& tree); // of no cut yet

    // Takes up what a cut of this tree has changed to. True: changed_slots() and changed_runs() tell all that differs from
    // what was there before. False: everything may differ, as after the first call, after changes by hand, where a
    // revision was missed, and where so much has changed that copying all is less.
    // Cost: about a tenth of a microsecond for each change; or some nanoseconds for each triangle, and with seams each leaf.
    bool update(const Cut& cut);

    // By slot: a triangle's corners, oriented like the input. As many as the cut has triangles, in no order.
    std::span<const Triangle> leaves_at_corners() const noexcept { return corners_; }
    // By leaf. Valid until the cut changes.
    std::span<const WedgeId> wedges_of_leaves() const noexcept { return wedges_; }

    // After update() has returned true. Slots below the number of triangles, in no order, and none twice. Runs do not
    // overlap unless they say the same.
    std::span<const Index> changed_slots() const noexcept { return changed_slots_; }
    std::span<const LeafRun> changed_runs() const noexcept { return changed_runs_; }

    std::uint64_t byte_size() const noexcept;

private:
    void list_all(const CutState& cut);
    void take_up(const CutState& cut);
    void fill_holes();
    void add_runs(const CutState& cut, NodeId node);

    VertexTree tree_;
    std::uint64_t revision_ = 0; // of the cut; 0: of none
    std::vector<Triangle> corners_;
    std::vector<Index> triangles_;     // by slot
    std::vector<Index> slots_;         // by triangle; no_slot where it is not active
    std::vector<WedgeId> seam_wedges_; // by leaf, of trees with seams; of others the cut knows them
    std::span<const WedgeId> wedges_;
    std::vector<Index> changed_slots_;
    std::vector<LeafRun> changed_runs_;
    std::vector<Index> holes_, coming_; // scratch
};

} // namespace unseen::vdtree
