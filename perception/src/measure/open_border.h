// Where the surface ends, and by how far folds move that.
#pragma once

#include <glm/geometric.hpp>

#include "measure/contacts.h"

namespace unseen::perception {

// Edges between places of an odd number of triangles, of one mostly. Triangles with the same corners count once. Folded, the border is what becomes
// of these edges: it goes with the triangles' corners.
class OpenBorder {
public:
    // Cost: nothing where the surface is closed; some 100 ns for each triangle of a place where it is not.
    OpenBorder(const vdtree::SoundTree& tree, const PlaceTriangles& mesh);

    bool is_empty() const { return ends_.empty(); }

    // A bit for each edge, from corner k to the next.
    unsigned edges_of(vdtree::Index triangle) const { return edges_of_.empty() ? 0 : edges_of_[triangle]; }

    // By the place at the one end; each edge is there twice.
    struct End {
        vdtree::Index place, other, opposite; // the third corner of the triangle
        auto operator<=>(const End&) const = default;
    };
    std::span<const End> at(vdtree::Index first_place, vdtree::Index place_end) const {
        if (ends_.empty()) return {};
        return std::span(ends_).subspan(first_end_[first_place], first_end_[place_end] - first_end_[first_place]);
    }

private:
    void find_edges(const vdtree::SoundTree& tree, const PlaceTriangles& mesh);
    void collect_ends(const vdtree::SoundTree& tree, const PlaceTriangles& mesh);

    std::vector<std::uint8_t> edges_of_; // by triangle; empty: there is no border
    std::vector<End> ends_;
    std::vector<vdtree::Index> first_end_; // by place, one more
};

struct Segment {
    glm::vec3 a, b;

    glm::vec3 nearest_to(const glm::vec3& point) const {
        const glm::vec3 ab = b - a;
        const float squared = glm::dot(ab, ab), along = glm::dot(point - a, ab);
        return a + (squared > 0 ? std::clamp(along / squared, 0.0f, 1.0f) : 0.0f) * ab;
    }
};

// On which side of a border a point lies that is near to it.
class BorderSide {
public:
    explicit BorderSide(const glm::vec3& point) : point_(point) {}

    // `inside`: a point of the surface beside the edge.
    void look_at(const Segment& edge, const glm::vec3& inside) {
        const glm::vec3 nearest = edge.nearest_to(point_), way = point_ - nearest;
        if (const float squared = glm::dot(way, way); squared <= (1 + rounding) * squared_)
            take(edge, inside, nearest, squared);
    }

    // Whether edges within a sphere can be nearer than those that were looked at.
    bool may_be_nearer(const glm::vec3& centre, float radius) const {
        const float distance = glm::length(point_ - centre) - radius;
        return !(distance > 0 && distance * distance > squared_);
    }

    // From the nearest edge of those that were looked at; infinite where none was.
    float distance() const;
    // The same where the point lies beyond that edge, and 0 where it lies on the surface's side.
    float outside() const;

private:
    static constexpr float rounding = 1e-5f; // edges that meet in the nearest point are equally near
    void take(const Segment& edge, const glm::vec3& inside, const glm::vec3& nearest, float squared);

    glm::vec3 point_, nearest_ = glm::vec3(0), inward_ = glm::vec3(0);
    float squared_ = std::numeric_limits<float>::infinity(); // the nearest point's distance
};

// The largest distance of a point from the nearest one of the segments; infinite where there are none.
float farthest_from(std::span<const Segment> segments, std::span<const glm::vec3> points);

class BorderShifts {
public:
    // Keeps references to both.
    BorderShifts(const vdtree::SoundTree& tree, const PlaceTriangles& mesh);

    // The largest distance, mesh units, between the mesh's own border and the one that the node's fold leaves: with no
    // neighbour folded, and with those that `stand_in` gives for leaves outside of the support. And how far triangles
    // that turn over reach beyond the border, in any state of the neighbours that are no larger than the node.
    // `crossing`: triangles with a corner in the support, among them all with one outside. 0 where the node is nowhere
    // near a border. Ask about the children before; threads may ask about different nodes at once. Cost: some products
    // for each edge of the border below the node, as long as the mesh's parts do not lie through each other and the tree
    // is no deeper than foliage's; at most some hundreds, after which the answer errs upwards.
    float shift(vdtree::NodeId node, std::span<const vdtree::Index> crossing,
                const FunctionRef<vdtree::NodeId(vdtree::Index leaf)>& stand_in);

private:
    struct Scratch {
        std::vector<Segment> folded, folded_alone; // with neighbours, and without
        std::vector<glm::vec3> points;
        std::vector<vdtree::NodeId> waiting, second, third;
        std::size_t looks_left = 0; // at nodes and edges of the mesh's own border
    };

    bool supports(vdtree::NodeId node, vdtree::Index leaf) const {
        return leaf - first_leaf_[node] < leaf_end_[node] - first_leaf_[node];
    }
    bool is_larger(vdtree::NodeId a, vdtree::NodeId b) const { // ancestors are larger than their descendants
        return support_[a].radius != support_[b].radius ? support_[a].radius > support_[b].radius : a < b;
    }
    const glm::vec3& at(vdtree::NodeId node) const { return tree_.position(node); }
    const glm::vec3& at_place(vdtree::Index place) const { return tree_.position(interior_ + place); }
    const glm::vec3& at_leaf(vdtree::Index leaf) const { return tree_.positions()[tree_.wedge_of_leaf(leaf)]; }
    std::span<const OpenBorder::End> border_of(vdtree::NodeId node) const;
    bool look_at_border(vdtree::NodeId top, BorderSide& side, Scratch& scratch) const;
    float distance_of_borders(vdtree::NodeId node, std::span<const vdtree::Index> crossing,
                              const FunctionRef<vdtree::NodeId(vdtree::Index)>& stand_in, Scratch& scratch) const;
    void find_stand_ins(vdtree::Index leaf, vdtree::NodeId node, vdtree::Index without,
                        std::vector<vdtree::NodeId>& nodes) const;
    float turned_reach(vdtree::NodeId node, std::span<const vdtree::Index> crossing, float least,
                       Scratch& scratch) const;
    // Infinite where there is too much to be looked at.
    float reach_of(vdtree::NodeId a, vdtree::NodeId b, vdtree::NodeId c, Scratch& scratch) const;

    const vdtree::SoundTree& tree_;
    OpenBorder border_;
    vdtree::NodeId interior_;
    std::span<const vdtree::Index> first_leaf_, leaf_end_;
    std::span<const vdtree::NodeId> parents_;
    std::span<const vdtree::Triangle> triangles_;
    std::span<const vdtree::Sphere> support_;
    // By interior node, of those near the border; most_border_levels where there was too much to be looked at, or below.
    std::vector<std::uint16_t> levels_below_;
};

} // namespace unseen::perception
