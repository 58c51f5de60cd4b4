#include "bound_facing.h"

#include <algorithm>
#include <array>
#include <limits>

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
    Folds(const BoundInput& input, const Ancestors& ancestors)
        : in_(input), ancestors_(ancestors), border_(input.shape.interior(), 0) {}

    // Calls see(node, a, b, c) for each such view from a node of the part, with the triangle's corners in order. Corners
    // outside of the part are looked up when they are needed.
    template <class See>
    void follow(const Triangle& triangle, const TreePart& part, See&& see) {
        const TreeShape& shape = in_.shape;
        NodeId nodes[3], above[3];
        Index next[3];   // when the corner moves to the node above; never: it is not followed
        bool current[3]; // whether the corner is where `nodes` says until then
        glm::vec3 at[3];
        const auto put = [&](std::size_t k, NodeId node) {
            nodes[k] = node;
            at[k] = in_.positions[node];
            above[k] = shape.parents[node];
            current[k] = above[k] != no_node && in_.parts.owns(part, above[k]);
            next[k] = current[k] ? shape.made[above[k]] : never;
        };
        for (std::size_t k = 0; k < 3; ++k) {
            const NodeId leaf = shape.node_of_leaf(triangle[k]);
            put(k, leaf);
            if (current[k] || !in_.parts.is_top(0) || !in_.parts.owns(part, 0)) continue;
            // Of the nodes above the other parts, the first is looked for.
            above[k] = ancestors_.lowest(above[k], [&](NodeId node) { return in_.parts.is_top(node); });
            next[k] = shape.made[above[k]];
        }
        for (;;) {
            const Index now = std::min(next[0], std::min(next[1], next[2]));
            const bool moves[3] = {next[0] == now, next[1] == now, next[2] == now};
            if (moves[0] + moves[1] + moves[2] != 1) return; // two corners meet, or none is followed
            const std::size_t k = moves[1] + 2u * moves[2];
            put(k, above[k]);
            const NodeId node = nodes[k];
            if (border_[node] > most_border_triangles) {
                // It faces everywhere already, and so do the nodes above: what they see is of no interest any more.
                current[k] = false;
                next[k] = never;
                continue;
            }
            for (std::size_t other = 0; other < 3; ++other) {
                if (current[other] || other == k) continue;
                nodes[other] = ancestors_.highest_made_by(nodes[other], now);
                at[other] = in_.positions[nodes[other]];
            }
            if (nodes[0] == nodes[1] || nodes[1] == nodes[2] || nodes[2] == nodes[0]) return;
            ++border_[node];
            see(node, at[0], at[1], at[2]);
        }
    }

    // Whether more triangles came by than were followed. To be asked when all have been.
    bool too_many(NodeId node) const { return border_[node] > most_border_triangles; }

private:
    const BoundInput& in_;
    const Ancestors& ancestors_;
    std::vector<std::uint16_t> border_; // by node: triangles around it after its fold, up to one too many
};

// Adds the directions of triangles to nodes and to leaves, some at a time.
class Views {
public:
    Views(std::span<Directions> nodes, std::span<Directions> leaves) : nodes_(nodes), leaves_(leaves) {}
    ~Views() { flush(); }
    Views(const Views&) = delete;
    Views& operator=(const Views&) = delete;

    // To one node, or to up to three leaves, `none` standing for those to leave out.
    void add(NodeId node, glm::vec3 a, glm::vec3 b, glm::vec3 c) { push({true, {node, none, none}}, a, b, c); }
    void add(const Triangle& leaves, glm::vec3 a, glm::vec3 b, glm::vec3 c) { push({false, leaves}, a, b, c); }

    static constexpr Index none = never;

private:
    struct Target {
        bool is_node;
        Triangle which;
    };
    void push(const Target& target, glm::vec3 a, glm::vec3 b, glm::vec3 c) {
        targets_[batch_.size()] = target;
        batch_.push(a, b, c);
        if (batch_.full()) flush();
    }
    void flush() {
        const std::size_t count = batch_.size();
        batch_.measure();
        for (std::size_t i = 0; i < count; ++i) {
            const Target& to = targets_[i];
            if (to.is_node) {
                batch_.insert(i, nodes_[to.which[0]]);
            } else {
                for (const Index leaf : to.which)
                    if (leaf != none) batch_.insert(i, leaves_[leaf]);
            }
        }
    }

    std::span<Directions> nodes_, leaves_;
    NormalBatch batch_;
    std::array<Target, NormalBatch::capacity> targets_;
};

} // namespace

NodeFacing bound_facing(const BoundInput& input, std::span<const Triangle> triangles, const LeafPlaces& places,
                        std::span<const Sphere> support, const Ancestors& ancestors) {
    const TreeShape& shape = input.shape;
    NodeFacing facing;
    facing.directions.resize(shape.interior());
    facing.flags.assign(shape.interior(), 0);

    std::vector<Directions> around(shape.leaves()); // by leaf: the normals of the triangles there
    Folds folds(input, ancestors);
    input.parts.for_each_triangle([&](const TreePart& part) {
        return [&, views = Views(facing.directions, around)](Index t) mutable {
            const Triangle& corners = triangles[t];
            const auto at = [&](std::size_t k) { return input.positions[shape.node_of_leaf(corners[k])]; };
            const auto owned = [&](Index leaf) { return input.parts.owns_leaf(part, leaf) ? leaf : Views::none; };
            views.add({owned(corners[0]), owned(corners[1]), owned(corners[2])}, at(0), at(1), at(2));
            folds.follow(corners, part,
                         [&](NodeId node, glm::vec3 a, glm::vec3 b, glm::vec3 c) { views.add(node, a, b, c); });
        };
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
            if (folds.too_many(node)) seen = Directions::everything();
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
