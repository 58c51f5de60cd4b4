#include "build/bound_spheres.h"

#include <glm/geometric.hpp>

#include "build/bounding_sphere.h"
#include "build/spatial_order.h"
#include <unseen/vdtree/internal/simd.h>

namespace unseen::vdtree {

namespace {

// Share of the radius: spheres that stick out by less do not move the centre any more. A smaller share would not pay,
// because the spheres of children add more.
constexpr double node_slack = 1e-3;

// Bounds the nodes of a part, children first, several at a time. Leaves are seen as points, interior children as their
// spheres.
class SphereWorker {
public:
    // `heights`: by interior node; how many there are below each other, itself the first.
    SphereWorker(const BoundInput& input, std::span<Index> heights, NodeSpheres& out)
        : in_(input), heights_(heights), out_(out) {}

    void operator()(std::span<const NodeId> nodes) {
        sort(nodes);
        for (std::size_t i = 0; i < sorted_.size();) {
            lanes_ = 0;
            do nodes_[lanes_++] = sorted_[i++].index;
            while (lanes_ < BallLanes::lanes && i < sorted_.size() &&
                   heights_[sorted_[i].index] == heights_[nodes_[0]]);
            bound();
        }
    }

private:
    // Nodes whose children are done before them, and whose bounding takes as long, come together.
    void sort(std::span<const NodeId> nodes) {
        sorted_.clear();
        for (std::size_t i = nodes.size(); i-- > 0;) {
            Index below = 0;
            std::uint64_t children = 0, points = 0;
            in_.shape.for_each_child(
                nodes[i],
                [&](NodeId child) {
                    below = std::max(below, heights_[child]);
                    ++children;
                },
                [&](Index leaf) {
                    const auto ring = in_.rings.around(leaf);
                    prefetch(ring.data()); // for bound()
                    points += 1 + ring.size();
                });
            heights_[nodes[i]] = below + 1;
            constexpr std::uint64_t most_children = 3, most_points = 63; // a byte for both
            sorted_.push_back(
                {std::uint64_t{below} << 8 | std::min(children, most_children) << 6 | std::min(points, most_points),
                 nodes[i]});
        }
        scratch_.resize(sorted_.size());
        sort_by_code(sorted_, scratch_);
    }

    void bound() {
        const auto leaves = in_.positions.subspan(in_.shape.place_of_leaf(0));
        std::array<Sphere, BallLanes::lanes> spheres;
        const std::span<Sphere> used = std::span(spheres).first(lanes_);
        for (std::size_t lane = 0; lane < lanes_; ++lane) {
            balls_.begin(lane, in_.positions[nodes_[lane]]);
            in_.shape.for_each_child(
                nodes_[lane], [&](NodeId child) { balls_.add(lane, out_.support[child]); },
                [&](Index leaf) { balls_.add(lane, leaves[leaf]); });
        }
        balls_.enclose(node_slack, used);
        for (std::size_t lane = 0; lane < lanes_; ++lane) {
            out_.support[nodes_[lane]] = spheres[lane];
            // The ring has all these points, too.
            balls_.forget_spheres(lane);
            in_.shape.for_each_child(
                nodes_[lane], [&](NodeId child) { balls_.add(lane, out_.ring[child]); },
                [&](Index leaf) { balls_.add(lane, leaves, in_.rings.around(leaf)); });
        }
        balls_.enclose(node_slack, used);
        for (std::size_t lane = 0; lane < lanes_; ++lane) out_.ring[nodes_[lane]] = spheres[lane];
    }

    const BoundInput& in_;
    std::span<Index> heights_;
    NodeSpheres& out_;
    std::vector<CodedIndex> sorted_, scratch_;
    BallLanes balls_;
    std::array<NodeId, BallLanes::lanes> nodes_; // being bounded
    std::size_t lanes_ = 0;
};

} // namespace

NodeSpheres bound_spheres(const BoundInput& input) {
    NodeSpheres spheres;
    spheres.support.resize(input.shape.interior());
    spheres.ring.resize(input.shape.interior());
    std::vector<Index> heights(input.shape.interior());
    input.parts.part_by_part([&] { return SphereWorker(input, heights, spheres); });
    return spheres;
}

Sphere bound_corners(const BoundInput& input) {
    std::vector<glm::dvec3> corners;
    for (Index leaf = 0; leaf < input.shape.leaves(); ++leaf)
        if (!input.rings.around(leaf).empty()) corners.push_back(input.leaf_position(leaf));
    return round_outward(smallest_sphere(corners));
}

} // namespace unseen::vdtree
