// Tests nodes against a distance criterion from one viewpoint: whether they unfold, and how far the eye may move before that can
// change.
#pragma once

#include <span>
#include <vector>

#include <vdtree/distance_criterion.h>
#include <vdtree/vertex_tree.h>

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
    double position = 0; // bounds the change of every node's distance and frustum height; rotations of the gaze count as lengths
    double facing = 0;   // the path of the eye
};

class FoldTester {
public:
    FoldTester(const VertexTree& tree, const DistanceCriterion& criterion, bool cull_back_faces);

    // Nodes unfold where their cost exceeds `threshold`. `length_per_radian` is what a rotation of the gaze counts as on the
    // position clock; any positive value will do, and it must be the same for verdicts and motions.
    void look_from(const Viewpoint& viewpoint, float threshold, double length_per_radian);

    // One verdict for each node. Cost: about ten nanoseconds a node.
    void test(std::span<const NodeId> nodes, std::span<Verdict> verdicts) const;

    // From one viewpoint to another with as many frusta of as many planes; infinite where these differ.
    static Motion motion(const VertexTree& tree, const Viewpoint& from, const Viewpoint& to, double length_per_radian);

private:
    struct Candidate; // a node whose facing decides
    struct FloatPlane {
        glm::vec3 normal;
        float offset; // of the plane through the eye's frame
    };

    float distance_of(std::uint16_t row, std::size_t bin, float length) const;
    std::size_t bin_of(float eccentricity) const;
    float folded_slack(std::uint16_t row, float length, float gap, float eccentricity) const;
    float unfolded_slack(std::uint16_t row, float length, float gap, float eccentricity) const;
    float turn_of(float path, float gap) const;
    bool is_outside(glm::vec3 to_centre, float radius, float& slack) const;
    void test_facing(std::span<const Candidate> candidates, std::span<Verdict> verdicts) const;

    const VertexTree& tree_;
    const DistanceCriterion& criterion_;
    bool cull_back_faces_;
    glm::dvec3 eye_ = glm::dvec3(0);
    glm::vec3 gaze_ = glm::vec3(0);
    bool has_gaze_ = false;
    float inverse_threshold_ = 1, inverse_bin_ = 0, turn_per_length_ = 0;
    std::vector<std::vector<FloatPlane>> frusta_;
};

} // namespace unseen::vdtree
