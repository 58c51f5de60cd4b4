#include "bound_facing.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>

#include <tbb/parallel_for.h>

#include "parallel_array.h"
#include "prefetch.h"

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
        : in_(input), ancestors_(ancestors), steps_(input.shape.parents.size()), border_(input.shape.interior(), 0) {
        const TreeShape& shape = input.shape;
        tbb::parallel_for(NodeId{0}, static_cast<NodeId>(steps_.size()), [&](NodeId node) {
            const NodeId above = shape.parents[node];
            const bool is_top = above == no_node || input.parts.is_top(node < shape.interior() ? node : above);
            const bool is_followed = above != no_node && input.parts.is_top(above) == is_top;
            steps_[node] = {input.positions[node], above, is_followed ? shape.made[above] : never};
        });
    }

    // Calls see(no_node, corners) for the triangle as it is, then see(node, corners) for each such view from a node of the part,
    // with the triangle's corners in order. Corners outside of the part are looked up when they are needed.
    template <class See>
    void follow(const Triangle& triangle, const TreePart& part, See&& see) {
        Corners c;
        for (std::size_t k = 0; k < 3; ++k) {
            const NodeId leaf = in_.shape.node_of_leaf(triangle[k]);
            c.put(k, leaf, steps_[leaf]);
        }
        see(no_node, c.at);
        for (std::size_t k = 0; k < 3; ++k) {
            if (in_.parts.owns_leaf(part, triangle[k])) continue;
            c.current[k] = false;
            c.next[k] = never;
            if (!in_.parts.is_top(0) || !in_.parts.owns(part, 0)) continue;
            // Of the nodes above the other parts, the first is looked for.
            c.above[k] = ancestors_.lowest(c.above[k], [&](NodeId node) { return in_.parts.is_top(node); });
            c.next[k] = in_.shape.made[c.above[k]];
        }
        if (c.current[0] && c.current[1] && c.current[2]) follow_all(c, see);
        else follow_some(c, see);
    }

    // Whether more triangles came by than were followed. To be asked when all have been.
    bool too_many(NodeId node) const { return border_[node] > most_border_triangles; }

private:
    // What a corner has to know when it comes to a node, in one piece.
    struct Step {
        glm::vec3 at;
        NodeId above;
        Index next; // when the corner moves on, to the node above; never: the part ends here
    };

    // A triangle while it is followed.
    struct Corners {
        Corner at[3];
        NodeId nodes[3], above[3];
        Index next[3];                // when the corner moves to the node above; never: it is not followed
        bool current[3];              // whether the corner is where `nodes` says until then

        void put(std::size_t k, NodeId node, const Step& step) {
            std::memcpy(&at[k], &step, sizeof(Corner));
            nodes[k] = node;
            above[k] = step.above;
            next[k] = step.next;
            current[k] = step.next != never;
        }
    };

    // With all three in the part, until two meet or one leaves it. Which corner moves is as good as random: it is an index, for the
    // processor is not to guess.
    template <class See>
    void follow_all(Corners& c, See&& see) {
        for (;;) {
            const Index now = std::min(c.next[0], std::min(c.next[1], c.next[2]));
            const unsigned first = c.next[0] == now, second = c.next[1] == now, third = c.next[2] == now;
            if (first + second + third != 1) return;
            const std::size_t k = second + 2 * third;
            const NodeId node = c.above[k];
            const Step& step = steps_[node];
            if (border_[node] > most_border_triangles || step.next == never) return follow_some(c, see);
            std::memcpy(&c.at[k], &step, sizeof(Corner));
            c.nodes[k] = node;
            c.above[k] = step.above;
            c.next[k] = step.next;
            ++border_[node];
            see(node, c.at);
        }
    }

    // With some of them elsewhere, or from where follow_all() does not know further.
    template <class See>
    void follow_some(Corners& c, See&& see) {
        for (;;) {
            const Index now = std::min(c.next[0], std::min(c.next[1], c.next[2]));
            const bool moves[3] = {c.next[0] == now, c.next[1] == now, c.next[2] == now};
            if (moves[0] + moves[1] + moves[2] != 1) return; // two corners meet, or none is followed
            const std::size_t k = moves[1] + 2u * moves[2];
            const NodeId node = c.above[k];
            c.put(k, node, steps_[node]);
            if (border_[node] > most_border_triangles) {
                // It faces everywhere already, and so do the nodes above: what they see is of no interest any more.
                c.current[k] = false;
                c.next[k] = never;
                continue;
            }
            for (std::size_t other = 0; other < 3; ++other) {
                if (c.current[other] || other == k) continue;
                c.nodes[other] = ancestors_.highest_made_by(c.nodes[other], now);
                std::memcpy(&c.at[other], &steps_[c.nodes[other]], sizeof(Corner));
            }
            if (c.nodes[0] == c.nodes[1] || c.nodes[1] == c.nodes[2] || c.nodes[2] == c.nodes[0]) return;
            ++border_[node];
            see(node, c.at);
        }
    }

    const BoundInput& in_;
    const Ancestors& ancestors_;
    ParallelArray<Step> steps_;         // by node
    std::vector<std::uint16_t> border_; // by node: triangles around it after its fold, up to one too many
};

// Adds the directions of triangles to nodes, or to up to three leaves each, `none` standing for those to leave out: many at a time.
template <std::size_t targets>
class Views {
public:
    using Target = std::array<Index, targets>;
    static constexpr Index none = never;

    explicit Views(std::span<Directions> seen) : seen_(seen) {}
    ~Views() { flush(); }
    Views(const Views&) = delete;
    Views& operator=(const Views&) = delete;

    void add(const Target& target, const Corner (&at)[3]) {
        targets_[batch_.size()] = target;
        for (const Index to : target)
            if (to != none) prefetch(&seen_[to]); // for flush()
        batch_.push(at[0], at[1], at[2]);
        if (batch_.full()) flush();
    }

private:
    void flush() {
        const std::size_t count = batch_.size();
        batch_.measure();
        for (std::size_t i = 0; i < count; ++i)
            for (const Index to : targets_[i])
                if (to != none) batch_.insert(i, seen_[to]);
    }

    std::span<Directions> seen_;
    NormalBatch batch_;
    std::array<Target, NormalBatch::capacity> targets_;
};

} // namespace

ParallelArray<Directions> bound_facing(const BoundInput& input, std::span<const Triangle> triangles, const LeafPlaces& places,
                                       std::span<const Sphere> support, const Ancestors& ancestors) {
    const TreeShape& shape = input.shape;
    ParallelArray<Directions> facing(shape.interior());

    ParallelArray<Directions> around(shape.leaves()); // by leaf: the normals of the triangles there
    Folds folds(input, ancestors);
    input.parts.for_each_triangle([&](const TreePart& part) {
        return [&, by_node = Views<1>(facing), by_leaf = Views<3>(around)](Index t) mutable {
            const Triangle& corners = triangles[t];
            const auto owned = [&](Index leaf) { return input.parts.owns_leaf(part, leaf) ? leaf : by_leaf.none; };
            folds.follow(corners, part, [&](NodeId node, const Corner(&at)[3]) {
                if (node != no_node) by_node.add({node}, at);
                else by_leaf.add({owned(corners[0]), owned(corners[1]), owned(corners[2])}, at);
            });
        };
    });
    // The dilation runs over places: an unwelded crease is no end of the surface.
    tbb::parallel_for(Index{0}, shape.leaves(), [&](Index leaf) { around[leaf].mark(places.irregular[leaf]); });
    for (Index leaf = 0; leaf < shape.leaves(); ++leaf)
        if (places.weld[leaf] != leaf) around[places.weld[leaf]] |= around[leaf];
    for (Index leaf = 0; leaf < shape.leaves(); ++leaf)
        if (places.weld[leaf] != leaf) around[leaf] = around[places.weld[leaf]];

    input.parts.bottom_up([&] {
        return [&](NodeId node) {
            Directions seen = facing[node];
            if (support[node].radius == 0) {
                facing[node] = {};
                return;
            }
            if (folds.too_many(node)) seen = Directions::everything();
            const auto add_leaf = [&](Index leaf) {
                const auto ring = input.rings.around(leaf);
                if (ring.empty()) return; // no triangle uses it
                seen |= around[leaf];
                for (const Index neighbour : ring) seen |= around[neighbour];
            };
            shape.for_each_child(
                node,
                [&](NodeId child) {
                    seen |= facing[child];
                    if (support[child].radius == 0) // it has none of its own
                        for (Index leaf = shape.first_leaf[child]; leaf < shape.leaf_end[child]; ++leaf) add_leaf(leaf);
                },
                add_leaf);
            facing[node] = seen;
        };
    });
    return facing;
}

} // namespace unseen::vdtree
