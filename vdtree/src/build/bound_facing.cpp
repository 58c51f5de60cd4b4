#include "build/bound_facing.h"

#include <limits>

#include <unseen/vdtree/internal/normal_mask.h>
#include <unseen/vdtree/internal/parallel.h>

#include <unseen/vdtree/internal/simd.h>

namespace unseen::vdtree {

namespace {

// A node with more triangles around it than this after its fold faces everywhere, and with it every node above: it is a
// good part of the model, mixed from almost everywhere, and replaying the folds of deep trees to the end would cost
// their size squared.
constexpr std::uint16_t most_border_triangles = 1024;

constexpr Index never = std::numeric_limits<Index>::max();

// Adds the directions of triangles to up to `targets` each, `none` standing for those to leave out: many at a time.
template <std::size_t targets>
class Views {
public:
    static constexpr Index none = never;

    explicit Views(std::span<Directions> seen) : seen_(seen) {}
    ~Views() { flush(); }
    Views(const Views&) = delete;
    Views& operator=(const Views&) = delete;

    void add(const std::array<Index, targets>& to, Corner a, Corner b, Corner c) { add_if(true, to, a, b, c); }
    // Without a branch on whether it counts.
    void add_if(bool counts, const std::array<Index, targets>& to, Corner a, Corner b, Corner c) {
        const std::size_t i = batch_.size();
        for (std::size_t k = 0; k < targets; ++k) {
            targets_[k][i] = to[k];
            if (to[k] != none) prefetch(&seen_[to[k]]); // for flush()
        }
        batch_.push_if(counts, a, b, c);
        if (batch_.full()) flush();
    }

private:
    void flush() {
        const std::size_t count = batch_.size();
        batch_.measure();
        for (std::size_t i = 0; i < count; ++i)
            for (std::size_t k = 0; k < targets; ++k)
                if (const Index to = targets_[k][i]; to != none) batch_.insert(i, seen_[to]);
    }

    std::span<Directions> seen_;
    NormalBatch batch_;
    std::array<std::array<Index, NormalBatch::capacity>, targets> targets_;
};

// Follows triangles through the folds of a part in the order in which the clusterer made them: whenever a corner moves
// to a proxy, the node of the proxy sees the triangle as it is then, until two corners meet and the triangle vanishes.
//
// Each step changes the node above one corner, and its number in the order of making grows from step to step, so it is
// the order of making that decides which corner moves next: nothing but the triangle's own ancestors has to be known.
// Which corner that is, and when a triangle vanishes, is as good as random, and the processor is not to guess: many
// triangles are followed in turns, a step each.
class Folds {
public:
    // Adds the directions that nodes see to `facing`, by node, and those around leaves to `around`, by their numbers
    // among the part's.
    Folds(const BoundInput& input, const Ancestors& ancestors, const TreePart& part, std::span<Directions> facing,
          std::span<Directions> around)
        : in_(input), ancestors_(ancestors), part_(part), is_top_(input.parts.is_top(part)),
          border_(part.end - part.begin, 0), by_node_(facing), by_leaf_(around) {
        if (is_top_) return; // it owns few of the nodes between its ends
        steps_.resize(part.end - part.begin + part.leaf_end - part.first_leaf);
        Step* step = steps_.data();
        for (NodeId node = part.begin; node < part.end; ++node) step_from(node, *step++);
        for (Index leaf = part.first_leaf; leaf < part.leaf_end; ++leaf)
            step_from(input.shape.place_of_leaf(leaf), *step++);
    }

    // `leaves`: the numbers of the triangle's corners among the part's leaves; none: elsewhere.
    void add(const Triangle& triangle, const Triangle& leaves) {
        if (is_top_ || leaves[0] == none || leaves[1] == none || leaves[2] == none)
            return follow_from_elsewhere(triangle, leaves);
        const Step* const leaf_steps = steps_.data() + (part_.end - part_.begin);
        Followed& f = followed_[count_];
        for (std::size_t k = 0; k < 3; ++k) f.put(k, leaf_steps[leaves[k]]);
        by_leaf_.add(leaves, f.at[0], f.at[1], f.at[2]);
        f.triangle = triangle;
        f.above[3] = part_.begin;
        if (++count_ == most_followed) follow_all();
    }
    // To be called when all have been added. `facing` and `around` are complete when this is destroyed.
    void finish() { follow_all(); }

    // Whether more triangles came by than were followed. To be asked in the end.
    bool too_many(NodeId node) const { return border_[node - part_.begin] > most_border_triangles; }

    static constexpr Index none = never;

private:
    // What a corner has to know when it comes to a node, in one piece.
    struct Step {
        glm::vec3 at;
        NodeId above;
        Index next; // when the corner moves on, to the node above; never: the part ends here

        Corner corner() const {
            Corner out;
            std::memcpy(&out, this, sizeof out);
            return out;
        }
    };

    void step_from(NodeId node, Step& step) const {
        step.at = in_.positions[node];
        step.above = in_.shape.parents[node];
        const bool is_followed = step.above != no_node && in_.parts.owns(part_, step.above);
        step.next = is_followed ? in_.shape.made[step.above] : never;
    }
    Step step_from(NodeId node) const {
        Step step;
        step_from(node, step);
        return step;
    }
    // Precondition: an interior node of the part.
    Step step_of(NodeId node) const { return is_top_ ? step_from(node) : steps_[node - part_.begin]; }

    // A triangle with all three corners in the part. A step that comes too late, for two corners have met, may use the
    // fourth places.
    struct Followed {
        Triangle triangle;
        Corner at[4];
        NodeId above[4];
        Index next[4]; // when the corner moves to the node above

        void put(std::size_t k, const Step& step) {
            at[k] = step.corner();
            above[k] = step.above;
            next[k] = step.next;
        }
    };

    // Until two corners meet, or one is about to leave the part.
    void follow_all() {
        std::array<std::uint8_t, most_followed> left;
        std::iota(left.begin(), left.end(), std::uint8_t{0});
        const Step* const steps = steps_.data();
        std::uint16_t* const borders = border_.data();
        const NodeId begin = part_.begin;
        for (std::size_t count = count_; count > 0;) {
            std::size_t kept = 0;
            for (std::size_t i = 0; i < count; ++i) {
                const std::uint8_t number = left[i];
                Followed& f = followed_[number];
                const Index next[3] = {f.next[0], f.next[1], f.next[2]};
                const Index sooner = next[0] < next[1] ? next[0] : next[1], now = sooner < next[2] ? sooner : next[2];
                const unsigned first = next[0] == now, second = next[1] == now, third = next[2] == now;
                const bool moves = first + second + third == 1;
                const std::size_t k = second + 2 * third;
                const NodeId node = f.above[k];
                const Step& step = steps[node - begin];
                std::uint16_t& border = borders[node - begin];
                if (border > most_border_triangles || step.next == never) [[unlikely]] {
                    if (moves) follow_further(f);
                    continue;
                }
                f.put(k, step);
                border = static_cast<std::uint16_t>(border + moves);
                by_node_.add_if(moves, {node}, f.at[0], f.at[1], f.at[2]);
                left[kept] = number;
                kept += moves;
            }
            count = kept;
        }
        count_ = 0;
    }

    // A triangle with corners that may be elsewhere, or that are not followed any more.
    struct Scattered {
        Corner at[3];
        NodeId nodes[3], above[3];
        Index next[3];   // when the corner moves to the node above; never: it is not followed
        bool current[3]; // whether the corner is where `nodes` says until then

        void put(std::size_t k, NodeId node, const Step& step) {
            at[k] = step.corner();
            nodes[k] = node;
            above[k] = step.above;
            next[k] = step.next;
            current[k] = step.next != never;
        }
    };

    void follow_from_elsewhere(const Triangle& triangle, const Triangle& leaves) {
        Scattered c;
        for (std::size_t k = 0; k < 3; ++k) {
            const NodeId leaf = in_.shape.place_of_leaf(triangle[k]);
            c.put(k, leaf, step_from(leaf));
        }
        by_leaf_.add(leaves, c.at[0], c.at[1], c.at[2]);
        for (std::size_t k = 0; k < 3; ++k) {
            if (leaves[k] != none) continue;
            c.current[k] = false;
            c.next[k] = never;
            if (!is_top_ || !in_.parts.is_top(0)) continue;
            // Finds the first of the nodes above the other parts.
            c.above[k] = ancestors_.lowest(c.above[k], [&](NodeId node) { return in_.parts.is_top(node); });
            c.next[k] = in_.shape.made[c.above[k]];
        }
        follow(c);
    }

    // From where follow_all() does not know further.
    void follow_further(const Followed& f) {
        Scattered c;
        for (std::size_t k = 0; k < 3; ++k) {
            const NodeId node = ancestors_.highest_made_by(in_.shape.place_of_leaf(f.triangle[k]), f.next[k] - 1);
            c.put(k, node, {glm::vec3(f.at[k][0], f.at[k][1], f.at[k][2]), f.above[k], f.next[k]});
        }
        follow(c);
    }

    void follow(Scattered& c) {
        for (;;) {
            const Index now = std::min(c.next[0], std::min(c.next[1], c.next[2]));
            const bool moves[3] = {c.next[0] == now, c.next[1] == now, c.next[2] == now};
            if (moves[0] + moves[1] + moves[2] != 1) return; // two corners meet, or none is followed
            const std::size_t k = moves[1] + 2u * moves[2];
            const NodeId node = c.above[k];
            c.put(k, node, step_of(node));
            std::uint16_t& border = border_[node - part_.begin];
            if (border > most_border_triangles) {
                // It faces everywhere already, and so do the nodes above: what they see is of no interest any more.
                c.current[k] = false;
                c.next[k] = never;
                continue;
            }
            for (std::size_t other = 0; other < 3; ++other) {
                if (c.current[other] || other == k) continue;
                c.nodes[other] = ancestors_.highest_made_by(c.nodes[other], now);
                const glm::vec3& at = in_.positions[c.nodes[other]];
                c.at[other] = Corner{at.x, at.y, at.z, 0};
            }
            if (c.nodes[0] == c.nodes[1] || c.nodes[1] == c.nodes[2] || c.nodes[2] == c.nodes[0]) return;
            ++border;
            by_node_.add({node}, c.at[0], c.at[1], c.at[2]);
        }
    }

    static constexpr std::size_t most_followed = 64; // at the same time

    const BoundInput& in_;
    const Ancestors& ancestors_;
    const TreePart& part_;
    bool is_top_;
    std::vector<Step> steps_;           // by node of the part, then by leaf; of those above the other parts none
    std::vector<std::uint16_t> border_; // by node of the part: triangles around it after its fold, up to one too many
    Views<1> by_node_;
    Views<3> by_leaf_;
    std::array<Followed, most_followed> followed_;
    std::size_t count_ = 0;
};

class FacingBounder {
public:
    FacingBounder(const BoundInput& input, std::span<const Triangle> triangles, std::span<const std::uint8_t> irregular,
                  std::span<const Sphere> support, const Ancestors& ancestors)
        : in_(input), triangles_(triangles), irregular_(irregular), support_(support), ancestors_(ancestors),
          facing_(input.shape.interior(), Unfilled()) {}

    ParallelArray<Directions> run() {
        std::vector<Outcome> outcomes(in_.parts.count());
        parallel_loop(std::size_t{0}, outcomes.size(), [&](std::size_t i) { look_around(in_.parts[i], outcomes[i]); });
        for (const Outcome& outcome : outcomes)
            for (const Letter& letter : outcome.letters) facing_[letter.to] |= letter.content;
        in_.parts.bottom_up([&] { return [&](NodeId node) { add_children(node); }; });
        return std::move(facing_);
    }

private:
    // What a part's places see that nodes of other parts are to know.
    struct Letter {
        Directions content;
        NodeId to;
    };
    struct Outcome {
        std::vector<Letter> letters;
    };

    // What the part's nodes see when they fold, and what is around its leaves.
    void look_around(const TreePart& part, Outcome& out) {
        for (NodeId node = part.begin; node < part.end; ++node)
            if (in_.parts.owns(part, node)) facing_[node] = {};
        const OwnLeaves leaves(in_, part);
        std::vector<Directions> around(leaves.size());
        {
            Folds folds(in_, ancestors_, part, facing_, around);
            TreeParts::for_each_triangle(part, [&](Index t) {
                const Triangle& corners = triangles_[t];
                folds.add(corners, {leaves.number(corners[0]), leaves.number(corners[1]), leaves.number(corners[2])});
            });
            folds.finish();
            for (NodeId node = part.begin; node < part.end; ++node)
                if (folds.too_many(node)) facing_[node] = Directions::everything();
        }
        for (Index i = 0; i < leaves.size(); ++i) around[i].mark(irregular_[leaves[i]]);
        spread(part, leaves, around, out);
    }

    // The leaves of a part, and their numbers among them.
    class OwnLeaves {
    public:
        OwnLeaves(const BoundInput& input, const TreePart& part)
            : parts_(input.parts), part_(part), first_(part.first_leaf), end_(part.leaf_end),
              is_top_(input.parts.is_top(part)) {
            for (Index leaf = first_; is_top_ && leaf < end_; ++leaf)
                if (input.parts.owns_leaf(part, leaf)) scattered_.push_back(leaf);
        }
        Index size() const { return is_top_ ? static_cast<Index>(scattered_.size()) : end_ - first_; }
        Index operator[](Index i) const { return is_top_ ? scattered_[i] : first_ + i; }
        // Folds::none: not of the part.
        Index number(Index leaf) const {
            if (!is_top_) return leaf - first_ < end_ - first_ ? leaf - first_ : Folds::none;
            if (!parts_.owns_leaf(part_, leaf)) return Folds::none;
            return static_cast<Index>(std::lower_bound(scattered_.begin(), scattered_.end(), leaf) -
                                      scattered_.begin());
        }

    private:
        const TreeParts& parts_;
        const TreePart& part_;
        Index first_, end_;
        bool is_top_;
        std::vector<Index> scattered_; // above the other parts: ascending
    };

    // Each place hears what is around itself and its neighbours; those in other parts get a letter.
    void spread(const TreePart& part, const OwnLeaves& leaves, std::span<const Directions> around, Outcome& out) {
        const bool is_top = in_.parts.is_top(part);
        for (Index i = 0; i < leaves.size(); ++i) {
            const auto ring = in_.rings.around(leaves[i]);
            if (!is_top && is_inside(part, ring)) { // most
                Directions seen = around[i];
                for (const Index neighbour : ring) seen |= around[neighbour - part.first_leaf];
                tell(part, listener(leaves[i]), seen, out);
                continue;
            }
            Directions seen = around[i];
            for (const Index neighbour : ring) {
                if (!in_.parts.owns_leaf(part, neighbour)) out.letters.push_back({around[i], listener(neighbour)});
                else seen |= around[leaves.number(neighbour)];
            }
            tell(part, listener(leaves[i]), seen, out);
        }
    }

    // Whether all of these are places of the part, which is not the top.
    bool is_inside(const TreePart& part, std::span<const Index> leaves) const {
        bool inside = true;
        for (const Index leaf : leaves) inside &= leaf - part.first_leaf < part.leaf_end - part.first_leaf;
        return inside;
    }

    void tell(const TreePart& part, NodeId node, const Directions& seen, Outcome& out) {
        if (in_.parts.owns(part, node)) facing_[node] |= seen;
        else out.letters.push_back({seen, node});
    }

    // The node that is to know what its leaf sees: those whose leaves are at one point do not.
    NodeId listener(Index leaf) const {
        NodeId node = in_.shape.parents[in_.shape.place_of_leaf(leaf)];
        while (support_[node].radius == 0 && node != 0) node = in_.shape.parents[node];
        return node;
    }

    void add_children(NodeId node) {
        if (support_[node].radius == 0) {
            facing_[node] = {};
            return;
        }
        Directions seen = facing_[node];
        in_.shape.for_each_child(
            node, [&](NodeId child) { seen |= facing_[child]; }, [](Index) {});
        facing_[node] = seen;
    }

    const BoundInput& in_;
    std::span<const Triangle> triangles_;
    std::span<const std::uint8_t> irregular_;
    std::span<const Sphere> support_;
    const Ancestors& ancestors_;
    ParallelArray<Directions> facing_; // by node
};

} // namespace

ParallelArray<Directions> bound_facing(const BoundInput& input, std::span<const Triangle> triangles,
                                       std::span<const std::uint8_t> irregular, std::span<const Sphere> support,
                                       const Ancestors& ancestors) {
    return FacingBounder(input, triangles, irregular, support, ancestors).run();
}

} // namespace unseen::vdtree
