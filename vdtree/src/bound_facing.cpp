#include "bound_facing.h"

#include <algorithm>
#include <limits>

#include <glm/geometric.hpp>
#include <tbb/blocked_range.h>

namespace unseen::vdtree {

namespace {

// A node with more triangles around it than this after its fold faces everywhere, and with it every node above: it is a good
// part of the model, mixed from almost everywhere, and replaying the folds of deep trees to the end would cost
// their size squared.
constexpr std::uint16_t most_border_triangles = 1024;

constexpr Index never = std::numeric_limits<Index>::max();

// Follows single triangles through the folds in the order in which the clusterer made them: whenever a corner moves to a
// proxy, the node of the proxy sees the triangle as it is then, until two corners meet and the triangle vanishes.
//
// Each step changes the node above one corner, and its number in the order of making grows from step to step, so it is the
// order of making that decides which corner moves next: nothing but the triangle's own ancestors has to be known.
class Folds {
public:
    Folds(const BoundInput& input, const Ancestors& ancestors, std::span<Directions> seen)
        : in_(input), ancestors_(ancestors), seen_(seen), border_(input.shape.interior(), 0) {}

    void follow(const Triangle& triangle) {
        Corner corners[3];
        for (std::size_t k = 0; k < 3; ++k) put(corners[k], in_.shape.node_of_leaf(triangle[k]));
        for (;;) {
            Corner& moving = corners[next_of(corners)];
            const Index now = moving.next;
            if (now == never) return;
            for (const Corner& other : corners)
                if (&other != &moving && other.next == now) return; // two corners meet
            put(moving, moving.above);
            if (border_[moving.node] > most_border_triangles) {
                // It faces everywhere already, and so do the nodes above: what they see is of no interest any more.
                moving.followed = false;
                moving.next = never;
                continue;
            }
            for (Corner& other : corners)
                if (!other.followed) move_to(other, ancestors_.highest_made_by(other.node, now));
            if (corners[0].node == corners[1].node || corners[1].node == corners[2].node ||
                corners[2].node == corners[0].node)
                return;
            ++border_[moving.node];
            seen_[moving.node].insert(
                glm::cross(corners[1].position - corners[0].position, corners[2].position - corners[0].position));
        }
    }

    // To be called when all triangles have been followed.
    void finish(NodeId node) const {
        if (border_[node] > most_border_triangles) seen_[node] = Directions::everything();
    }

private:
    struct Corner {
        NodeId node;
        NodeId above;
        Index next;  // when it moves there
        bool followed = true;
        glm::dvec3 position;
    };

    static std::size_t next_of(const Corner (&c)[3]) {
        if (c[0].next <= c[1].next) return c[0].next <= c[2].next ? 0 : 2;
        return c[1].next <= c[2].next ? 1 : 2;
    }
    void move_to(Corner& corner, NodeId node) const {
        corner.node = node;
        corner.position = in_.position(node);
    }
    void put(Corner& corner, NodeId node) const {
        move_to(corner, node);
        corner.above = in_.shape.parents[node];
        corner.next = corner.above == no_node ? never : in_.shape.made[corner.above];
    }

    const BoundInput& in_;
    const Ancestors& ancestors_;
    std::span<Directions> seen_;
    std::vector<std::uint16_t> border_; // by node: triangles around it after its fold, up to one too many
};

} // namespace

NodeFacing bound_facing(const BoundInput& input, std::span<const Triangle> triangles,
                        const LeafPlaces& places, std::span<const Sphere> support, const Ancestors& ancestors) {
    const TreeShape& shape = input.shape;
    NodeFacing facing;
    facing.directions.resize(shape.interior());
    facing.flags.assign(shape.interior(), 0);

    std::vector<Directions> around(shape.leaves()); // by leaf: the normals of the triangles there
    Folds folds(input, ancestors, facing.directions);
    input.parts.for_each_triangle(triangles, [&](Index t) {
        const Triangle& corners = triangles[t];
        const glm::dvec3 a = input.leaf_position(corners[0]);
        Directions normal;
        normal.insert(glm::cross(input.leaf_position(corners[1]) - a, input.leaf_position(corners[2]) - a));
        for (const Index leaf : corners) around[leaf] |= normal;
        folds.follow(corners);
    });
    // The dilation runs over places: an unwelded crease is no end of the surface.
    for (Index leaf = 0; leaf < shape.leaves(); ++leaf)
        if (places.weld[leaf] != leaf) around[places.weld[leaf]] |= around[leaf];
    for (Index leaf = 0; leaf < shape.leaves(); ++leaf)
        if (places.weld[leaf] != leaf) around[leaf] = around[places.weld[leaf]];

    input.parts.bottom_up([&] {
        return [&](NodeId node) {
            Directions& seen = facing.directions[node];
            if (support[node].radius == 0) {
                seen = {};
                return;
            }
            folds.finish(node);
            std::uint8_t flags = 0;
            const auto add_leaf = [&](Index leaf) {
                const auto ring = input.rings.around(leaf);
                if (ring.empty()) return; // no triangle uses it
                seen |= around[leaf];
                bool irregular = places.irregular[leaf];
                for (const Index neighbour : ring) {
                    seen |= around[neighbour];
                    irregular |= places.irregular[neighbour];
                }
                if (irregular) flags |= irregular_ring;
            };
            shape.for_each_child(
                node,
                [&](NodeId child) {
                    seen |= facing.directions[child];
                    flags |= facing.flags[child];
                    if (support[child].radius == 0) // it has none of its own
                        for (Index leaf = shape.first_leaf[child]; leaf < shape.leaf_end[child]; ++leaf) add_leaf(leaf);
                },
                add_leaf);
            facing.flags[node] = flags;
        };
    });
    return facing;
}

} // namespace unseen::vdtree
