#include "build/needs.h"

#include <algorithm>
#include <bit>
#include <utility>

#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/tree_shape.h>

#include "tree/turned.h"

namespace unseen::vdtree {

namespace {

// While `node` is unfolded, `needed` has to be.
struct Need {
    NodeId node, needed;
    auto operator<=>(const Need&) const = default;
};

// A triangle is drawn in some fifty ways, in all cuts; in trees as deep as they are large in very many. Then triangles are
// looked at in cuts by size only, and so far up.
constexpr std::size_t ways_a_triangle = 1024; // on average, at most
constexpr std::size_t longest_chain = 64;     // nodes above a corner that are looked at

class NeedFinder {
public:
    explicit NeedFinder(const TreeGeometry& geometry)
        : g_(geometry), tree_(links_of(geometry)), order_(tree_.interior()), joins_(tree_.interior(), 0) {
        std::vector<float> size(tree_.interior());
        for (NodeId node = tree_.interior(); node-- > 0;) {
            size[node] = std::max(size[node], g_.support_spheres[node].radius);
            if (node > 0) size[g_.parents[node]] = std::max(size[g_.parents[node]], size[node]);
            order_[node] = std::uint64_t{std::bit_cast<std::uint32_t>(size[node])} << 32 | (no_node - node);
        }
        find_vanishing();
        if (!g_.uvs.empty()) find_mirrors();
    }

    NeedArrays<Vector> find() {
        std::vector<Index> triangles(g_.triangles.size());
        for (Index t = 0; t < triangles.size(); ++t) triangles[t] = t;
        std::vector<NeedOfTriangle> found;
        for (int round = 0;; ++round) {
            std::vector<Need> impossible = look_at(triangles, found);
            if (impossible.empty()) impossible = needed_too_often(found);
            if (impossible.empty()) break;
            triangles = take_around(reorder(impossible, round), found);
        }
        std::vector<Need> needs;
        needs.reserve(found.size());
        for (const NeedOfTriangle& need : found)
            if (need.need.node != no_node) needs.push_back(need.need);
        for (NodeId node = 1; node < tree_.interior(); ++node)
            if (joins_[node]) needs.push_back({g_.parents[node], node});
        return arrays_of(std::move(needs));
    }

private:
    // A node that can stand for a corner, and the next one above that does not fold with its parent.
    struct Stand {
        NodeId node, above;
        glm::vec3 position;
        glm::vec2 uv;
        bool is_on_mirror;
    };
    using Chain = std::vector<Stand>;
    // Each triangle that turns over in some cut adds one or more; one without nodes, if nothing has to be needed.
    struct NeedOfTriangle {
        Index triangle;
        Need need;
    };
    struct Found {
        std::vector<NeedOfTriangle> needs;
        std::vector<Need> impossible;
    };
    struct Ways {
        std::array<Chain, 3> chains;
        std::vector<double> x, y, z; // of the last chain, relative to the first corner's place
        std::vector<Need> needs;
        std::size_t left = 0; // to try at the triangles to come
    };

    void find_vanishing() {
        vanishes_at_.resize(g_.triangles.size());
        for (NodeId node = 0; node < tree_.interior(); ++node)
            std::fill(vanishes_at_.begin() + g_.first_triangle[node],
                      vanishes_at_.begin() + g_.first_triangle[node + 1], node);
    }

    // Where a map folds over itself, triangles of both orientations in the texture meet at a leaf. What is drawn across that
    // line has no right one.
    void find_mirrors() {
        constexpr std::uint8_t mirrored = 1, upright = 2, both = 3;
        on_mirror_.assign(g_.uvs.size(), 0);
        for (const Triangle& t : g_.triangles) {
            std::array<WedgeId, 3> w;
            for (std::size_t k = 0; k < 3; ++k) w[k] = tree_.wedge_of_leaf(t[k]);
            const float area = uv_area({g_.uvs[w[0]], g_.uvs[w[1]], g_.uvs[w[2]]});
            for (const WedgeId corner : w) on_mirror_[corner] |= area < 0 ? mirrored : area > 0 ? upright : 0;
        }
        const NodeId nodes = static_cast<NodeId>(g_.parents.size());
        for (NodeId node = tree_.interior(); node < nodes; ++node)
            for (WedgeId w = tree_.first_wedge_of(node); w < tree_.first_wedge_of(node + 1); ++w) {
                on_mirror_[w] = on_mirror_[w] == both;
                hand_up(node, w);
            }
        for (NodeId node = tree_.interior(); node-- > 1;)
            for (WedgeId w = tree_.first_wedge_of(node); w < tree_.first_wedge_of(node + 1); ++w) hand_up(node, w);
    }
    void hand_up(NodeId node, WedgeId w) {
        if (on_mirror_[w]) on_mirror_[tree_.wedge_above(g_.parents[node], w)] = 1;
    }

    bool is_smaller(NodeId a, NodeId b) const { return order_of(a) < order_of(b); }
    std::uint64_t order_of(NodeId node) const { return node < tree_.interior() ? order_[node] : 0; }

    // Puts what is needed by larger nodes behind these, or where that would be behind its parent, lets it join that one.
    // Returns the nodes that are elsewhere now.
    std::vector<NodeId> reorder(std::span<const Need> impossible, int round) {
        constexpr int most_rounds = 6; // with more some go round in circles; from then on all join
        std::vector<NodeId> changed;
        for (const auto [node, needed] : impossible) {
            changed.push_back(needed);
            const NodeId parent = head_of(g_.parents[needed]);
            if (node == parent || round > most_rounds || order_[node] + 1 >= order_[parent]) joins_[needed] = 1;
            else order_[needed] = std::max(order_[needed], order_[node] + 1);
        }
        return changed;
    }
    NodeId head_of(NodeId node) const {
        while (joins_[node]) node = g_.parents[node];
        return node;
    }

    // Whether a triangle with corners at two nodes may turn over where the third one is any of its chain. Mostly it does
    // not, and this takes less than the tests themselves.
    class SideFilter {
    public:
        SideFilter(const glm::dvec3& normal, Ways& ways)
            : origin_(ways.chains[0][0].position), normal_(normal), ways_(ways) {
            const Chain& c = ways.chains[2];
            for (std::vector<double>* const to : {&ways.x, &ways.y, &ways.z}) to->resize(c.size());
            for (std::size_t i = 0; i < c.size(); ++i) {
                const glm::dvec3 p = glm::dvec3(c[i].position) - origin_;
                ways.x[i] = p.x, ways.y[i] = p.y, ways.z[i] = p.z;
            }
            double extent = 0;
            for (const Chain& chain : ways.chains)
                for (const Stand& stand : chain)
                    extent = std::max(extent, glm::length(glm::dvec3(stand.position) - origin_));
            constexpr double rounding = 1e-13; // of some ten operations, and more
            slack_ = rounding * glm::length(normal) * extent * extent;
        }
        bool may_turn(const glm::vec3& at_a, const glm::vec3& at_b) const {
            const glm::dvec3 a = glm::dvec3(at_a) - origin_, b = glm::dvec3(at_b) - origin_;
            const glm::dvec3 side = glm::cross(normal_, b - a);
            const double least = glm::dot(side, a) + slack_;
            int few = 0;
            for (std::size_t i = 0; i < ways_.x.size(); ++i)
                few |= side.x * ways_.x[i] + side.y * ways_.y[i] + side.z * ways_.z[i] < least;
            return few != 0;
        }

    private:
        glm::dvec3 origin_, normal_;
        const Ways& ways_;
        double slack_;
    };

    // Adds what is found at those triangles; returns needs of nodes that are not smaller than what they need.
    std::vector<Need> look_at(std::span<const Index> triangles, std::vector<NeedOfTriangle>& needs) const {
        constexpr std::size_t at_once = 2048; // triangles
        std::vector<Found> found(triangles.size() / at_once + 1);
        parallel_loop(std::size_t{0}, found.size(), [&](std::size_t part) {
            Ways ways;
            ways.left = at_once * ways_a_triangle;
            const std::size_t end = std::min(triangles.size(), (part + 1) * at_once);
            for (std::size_t i = part * at_once; i < end; ++i) look_at(triangles[i], ways, found[part]);
        });
        std::vector<Need> impossible;
        for (const Found& part : found) {
            needs.insert(needs.end(), part.needs.begin(), part.needs.end());
            impossible.insert(impossible.end(), part.impossible.begin(), part.impossible.end());
        }
        return impossible;
    }

    // Counts of a cut take two bytes.
    std::vector<Need> needed_too_often(std::span<const NeedOfTriangle> needs) const {
        std::vector<std::uint32_t> times(tree_.interior());
        std::vector<Need> often;
        for (const NeedOfTriangle& need : needs)
            if (const NodeId needed = need.need.needed; needed != no_node && ++times[needed] == 0xffff)
                often.push_back({head_of(g_.parents[needed]), needed});
        return often;
    }

    // Takes out what was found at triangles that these nodes can be corners of, and returns these triangles.
    std::vector<Index> take_around(std::span<const NodeId> nodes, std::vector<NeedOfTriangle>& found) const {
        std::vector<std::uint8_t> is_one(tree_.interior());
        for (const NodeId node : nodes) is_one[node] = 1;
        const auto is_near = [&](Index t) {
            return std::ranges::any_of(g_.triangles[t], [&](Index leaf) {
                NodeId node = g_.parents[tree_.place_of_leaf(leaf)];
                for (std::size_t step = 0; step < longest_chain && !is_one[node]; ++step) {
                    if (is_above(node, vanishes_at_[t]) && !joins_[node]) return false;
                    node = g_.parents[node];
                }
                return is_one[node] != 0;
            });
        };
        std::vector<Index> triangles;
        Index last = no_node; // whose needs follow each other
        bool is_taken = false;
        std::erase_if(found, [&](const NeedOfTriangle& need) {
            if (need.triangle != std::exchange(last, need.triangle)) {
                is_taken = is_near(need.triangle);
                if (is_taken) triangles.push_back(need.triangle);
            }
            return is_taken;
        });
        return triangles;
    }

    void look_at(Index t, Ways& ways, Found& found) const {
        const Triangle& leaves = g_.triangles[t];
        std::size_t count = 1;
        for (std::size_t k = 0; k < 3; ++k) {
            find_chain(leaves[k], vanishes_at_[t], ways.chains[k]);
            count *= ways.chains[k].size();
        }
        if (count == 1) return;
        const auto& [a, b, c] = ways.chains;
        const bool has_uvs = !g_.uvs.empty();
        const TurnedTest test({a[0].position, b[0].position, c[0].position},
                              has_uvs ? TurnedTest::Uvs{a[0].uv, b[0].uv, c[0].uv} : TurnedTest::Uvs{});
        ways.needs.clear();
        bool any = false;
        const auto try_way = [&](const Stand& at_a, const Stand& at_b, const Stand& at_c) {
            const auto is_mirrored = [&] {
                const bool is_mirror = at_a.is_on_mirror | at_b.is_on_mirror | at_c.is_on_mirror;
                return !is_mirror && test.is_mirrored({at_a.uv, at_b.uv, at_c.uv});
            };
            if (!test.is_turned({at_a.position, at_b.position, at_c.position}) && !(has_uvs && is_mirrored())) return;
            any = true;
            prevent(at_a, at_b, at_c, ways.needs, found.impossible);
        };
        if (count <= ways.left) {
            ways.left -= count;
            const SideFilter filter(test.normal(), ways);
            for (const Stand& at_a : a)
                for (const Stand& at_b : b)
                    if (has_uvs || filter.may_turn(at_a.position, at_b.position))
                        for (const Stand& at_c : c) try_way(at_a, at_b, at_c);
        } else {
            std::array<std::size_t, 3> at{};
            do try_way(a[at[0]], b[at[1]], c[at[2]]);
            while (go_up(ways.chains, at));
        }
        keep_least(ways.needs);
        if (any && ways.needs.empty()) ways.needs.push_back({no_node, no_node});
        for (const Need& need : ways.needs) found.needs.push_back({t, need});
    }

    // To the next cut by size.
    bool go_up(const std::array<Chain, 3>& chains, std::array<std::size_t, 3>& at) const {
        std::size_t next = 0;
        for (std::size_t k = 1; k < 3; ++k)
            if (is_smaller(chains[k][at[k]].above, chains[next][at[next]].above)) next = k;
        return ++at[next] < chains[next].size();
    }

    bool is_above(NodeId node, NodeId below) const { return node <= below && below < g_.subtree_end[node]; }

    // From the place up to what stands for two corners.
    void find_chain(Index leaf, NodeId vanishes_at, Chain& chain) const {
        chain.clear();
        const auto add = [&](NodeId node) {
            const WedgeId w = node < tree_.interior() ? tree_.wedge_at(node, leaf) : tree_.wedge_of_leaf(leaf);
            if (!chain.empty()) chain.back().above = node;
            Stand& stand = chain.emplace_back();
            stand.node = node;
            stand.position = g_.positions[w];
            if (g_.uvs.empty()) return;
            stand.uv = g_.uvs[w];
            stand.is_on_mirror = on_mirror_[w] != 0;
        };
        NodeId node = tree_.place_of_leaf(leaf);
        add(node);
        node = g_.parents[node];
        for (std::size_t step = 0; step < longest_chain && !is_above(node, vanishes_at); ++step) {
            if (!joins_[node]) add(node);
            node = g_.parents[node];
        }
        chain.back().above = head_of(node);
    }

    // The largest one shall be unfolded where the smaller ones are active and its parent is unfolded: by the smallest of the
    // nodes above the three.
    void prevent(const Stand& a, const Stand& b, const Stand& c, std::vector<Need>& needs,
                 std::vector<Need>& impossible) const {
        const Stand *large = &a, *one = &b, *other = &c;
        if (is_smaller(large->node, one->node)) std::swap(large, one);
        if (is_smaller(large->node, other->node)) std::swap(large, other);
        NodeId above = is_smaller(one->above, other->above) ? one->above : other->above;
        if (is_smaller(above, large->node)) return needs.push_back({above, large->node});
        if (is_smaller(large->above, above)) above = large->above;
        impossible.push_back({above, large->node});
    }

    // Without those that follow from another one, for an unfolded node is under unfolded ones.
    void keep_least(std::vector<Need>& needs) const {
        std::ranges::sort(needs, {}, [](const Need& need) { return std::pair(need.needed, need.node); });
        std::size_t kept = 0;
        for (const Need& need : needs) {
            if (kept > 0 && needs[kept - 1].needed == need.needed &&
                need.node < g_.subtree_end[needs[kept - 1].node]) // ancestors come first
                continue;
            needs[kept++] = need;
        }
        needs.resize(kept);
    }

    NeedArrays<Vector> arrays_of(std::vector<Need> needs) const {
        NeedArrays<Vector> arrays;
        keep_least(needs);
        if (needs.empty()) return arrays;
        std::ranges::sort(needs);
        const std::size_t words = tree_.interior() / 32 + 1;
        arrays.needing.resize(words);
        for (std::size_t i = 0; i < needs.size(); ++i) {
            const auto [node, needed] = needs[i];
            if (i == 0 || needs[i - 1].node != node) arrays.first_need.push_back(static_cast<Index>(i));
            arrays.needs.push_back(needed | (joins_[needed] ? joined_need : 0));
            arrays.needing[node / 32].bits |= 1u << (node % 32);
        }
        arrays.first_need.push_back(static_cast<Index>(needs.size()));
        for (std::size_t word = 1; word < words; ++word)
            arrays.needing[word].before = arrays.needing[word - 1].before + count_bits(arrays.needing[word - 1].bits);
        return arrays;
    }

    const TreeGeometry& g_;
    const TreeLinks tree_;
    std::vector<std::uint64_t> order_;    // by interior node: sizes first, and behind parents
    std::vector<std::uint8_t> joins_;     // by interior node: folds and unfolds with its parent
    std::vector<NodeId> vanishes_at_;     // by triangle
    std::vector<std::uint8_t> on_mirror_; // by wedge; empty without uvs
};

} // namespace

NeedArrays<Vector> find_needs(const TreeGeometry& geometry) { return NeedFinder(geometry).find(); }

} // namespace unseen::vdtree
