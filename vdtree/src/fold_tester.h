// Tests nodes against a distance criterion from one viewpoint: whether they unfold, and how far the eye may move before that can
// change.
#pragma once

#include <span>
#include <vector>

#include <vdtree/distance_criterion.h>
#include <vdtree/vertex_tree.h>

#include "fold_kernel.h"

namespace unseen::vdtree {

// What a test found. The verdict holds while the position clock has advanced by less than `position_slack` and the facing
// clock by less than `facing_slack` (mesh units, 0 or more; see Motion).
struct Verdict {
    float position_slack = 0;
    float facing_slack = 0;
    float cost = 0; // D over the distance: folded where at most the threshold; unbounded where the eye is inside
    bool unfolded = false;
};

// How much a move from one viewpoint to another advances the two clocks.
struct Motion {
    double position = 0; // bounds the change of every node's distance; rotations of the gaze count as lengths
    double facing = 0;   // the path of the eye, or the change of a height over a frustum's plane where that is more
};

class FoldTester {
public:
    // Nodes unfold where their cost exceeds `threshold`. Cost: the criterion's table.
    FoldTester(const VertexTree& tree, const DistanceCriterion& criterion, bool cull_back_faces, float threshold);

    // `length_per_radian` is what a rotation of the gaze counts as on the
    // position clock; any positive value will do, and it must be the same for verdicts and motions.
    void look_from(const Viewpoint& viewpoint, double length_per_radian);

    // One verdict for each node. Cost: about ten nanoseconds a node.
    void test(std::span<const NodeId> nodes, std::span<Verdict> verdicts) const;

    // From one viewpoint to another with as many frusta of as many planes; infinite where these differ.
    static Motion motion(const VertexTree& tree, const Viewpoint& from, const Viewpoint& to, double length_per_radian);

private:
    struct Lane; // one node of a batch

    void test_batch(std::span<const NodeId> nodes, Verdict* verdicts) const;
    Lane lane_of(NodeId node, const SphereBatch& spheres, std::size_t i) const;
    Verdict judge(const Lane& lane, float front, float back) const;
    Verdict judge_by_distance(const Lane& lane) const;
    float cost_of(std::uint16_t row, const Lane& lane, float reach) const;
    float distance_of(std::uint16_t row, std::size_t bin, float length) const;
    std::size_t bin_of(float eccentricity) const;
    float path_of(float turn, float gap) const;
    float folded_slack(std::uint16_t row, const Lane& lane, float reach) const;
    float unfolded_slack(std::uint16_t row, const Lane& lane, float reach) const;

    const VertexTree& tree_;
    const DistanceCriterion& criterion_;
    bool cull_back_faces_, has_silhouettes_;
    KernelView view_;
    float threshold_ = 1, inverse_bin_ = 0, turn_per_length_ = 0, last_bin_ = 0;
    std::vector<float> reach_; // of the criterion, at the threshold: infinite where the fold is seen from everywhere
    std::size_t bins_ = 1;
};

} // namespace unseen::vdtree
