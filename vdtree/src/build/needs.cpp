#include "build/needs.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <utility>

#include <glm/gtc/type_ptr.hpp>

#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/simd.h>
#include <unseen/vdtree/internal/tree_shape.h>

#include "build/spatial_order.h"
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
        : g_(geometry), tree_(links_of(geometry)), order_(tree_.interior()), joins_(tree_.interior(), 0),
          first_leaf_(tree_.wedge_of_leaf(0)) {
        std::vector<float> size(tree_.interior());
        for (NodeId node = tree_.interior(); node-- > 0;) {
            size[node] = std::max(size[node], g_.support_spheres[node].radius);
            if (node > 0) size[g_.parents[node]] = std::max(size[g_.parents[node]], size[node]);
            order_[node] = std::uint64_t{std::bit_cast<std::uint32_t>(size[node])} << 32 | (no_node - node);
        }
        find_vanishing();
        list_wedges();
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
    // What can stand for a corner, from its place up to below where two corners meet, without what folds with its parent.
    struct Chain {
        std::size_t size;
        std::array<NodeId, longest_chain + 2> nodes; // and the next one above
        std::array<WedgeId, longest_chain + 1> wedges;
        std::array<std::uint64_t, longest_chain + 2>
            orders; // of the nodes; only found where a way turns the triangle over
    };
    // Each triangle that turns over in some cut adds one or more; one without nodes, if nothing has to be needed.
    struct NeedOfTriangle {
        Index triangle;
        Need need;
    };
    struct Found {
        std::vector<NeedOfTriangle> needs;
        std::vector<Need> impossible;
    };

    void find_vanishing() {
        vanishes_at_.resize(g_.triangles.size());
        for (NodeId node = 0; node < tree_.interior(); ++node)
            std::fill(vanishes_at_.begin() + g_.first_triangle[node],
                      vanishes_at_.begin() + g_.first_triangle[node + 1], node);
    }

    void list_wedges() {
        above_leaf_.reserve(tree_.leaves());
        for (Index leaf = 0; leaf < tree_.leaves(); ++leaf)
            above_leaf_.push_back(g_.parents[tree_.place_of_leaf(leaf)]);
        if (!tree_.has_seams()) return;
        for (NodeId node = 0; node < tree_.interior(); ++node)
            wedge_of_node_.push_back(is_in(tree_.several, node) ? several_wedges : tree_.first_wedge_of(node));
    }
    WedgeId wedge_at(NodeId node, Index leaf) const {
        if (wedge_of_node_.empty()) return node;
        const WedgeId only = wedge_of_node_[node];
        return only != several_wedges ? only : tree_.wedge_at(node, leaf);
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

    // Where a triangle is seen from its front, and likewise in the texture: its corners' chains in floats. Mostly this says
    // whether a way turns it over, and takes less than the test itself.
    class Front {
    public:
        static constexpr std::size_t lanes = 4;

        // Shows places along the triangle's normal on the plane of two axes, relative to a corner: there the triangle runs
        // counter-clockwise.
        class Aim {
        public:
            UNSEEN_INLINE Aim(const glm::vec3& corner, const glm::dvec3& normal) {
                const glm::dvec3 size(std::fabs(normal.x), std::fabs(normal.y), std::fabs(normal.z));
                axis_ = size.x > size.y ? (size.x > size.z ? 0 : 2) : (size.y > size.z ? 1 : 2);
                const double *n = glm::value_ptr(normal), by = 1 / n[axis_];
                constexpr std::array<int, 5> after{0, 1, 2, 0, 1};
                u_ = after[static_cast<std::size_t>(axis_ + (n[axis_] > 0 ? 1 : 2))], v_ = 3 - axis_ - u_;
                const float* p = glm::value_ptr(corner);
                at_ = p[axis_], at_u_ = p[u_], at_v_ = p[v_];
                u_by_ = static_cast<float>(n[u_] * by), v_by_ = static_cast<float>(n[v_] * by);
            }
            UNSEEN_INLINE glm::vec2 operator()(const glm::vec3& place) {
                const float* p = glm::value_ptr(place);
                const float along = p[axis_] - at_, u = p[u_] - at_u_, v = p[v_] - at_v_;
                farthest_ = std::max(farthest_, along * along + u * u + v * v);
                return {u - along * u_by_, v - along * v_by_}; // up to twice as far as the place
            }
            float farthest() const { return farthest_; } // of the places, squared

        private:
            int axis_, u_, v_;
            float at_, at_u_, at_v_, u_by_, v_by_, farthest_ = 0;
        };

        // The i-th place of chain k.
        UNSEEN_INLINE void put(std::size_t k, std::size_t i, glm::vec2 p) { x_[k][i] = p.x, y_[k][i] = p.y; }
        UNSEEN_INLINE void finish(const std::array<Chain, 3>& chains, float farthest) {
            constexpr float share = 2e-5f;          // of the farthest one's square; roundings are below a tenth of that
            constexpr float least_squared = 1e-30f; // below, floats are too coarse for shares of it
            slack_ = farthest > least_squared ? share * farthest : std::numeric_limits<float>::infinity();
            for (std::size_t k = 1; k < 3; ++k)
                for (std::size_t i = chains[k].size; i % lanes != 0; ++i)
                    x_[k][i] = x_[k][i - 1], y_[k][i] = y_[k][i - 1];
            Float4 low_x = lanes_of(x_[2], 0), high_x = low_x, low_y = lanes_of(y_[2], 0), high_y = low_y;
            for (std::size_t i = lanes; i < chains[2].size; i += lanes) {
                const Float4 x = lanes_of(x_[2], i), y = lanes_of(y_[2], i);
                low_x = x < low_x ? x : low_x, high_x = x > high_x ? x : high_x;
                low_y = y < low_y ? y : low_y, high_y = y > high_y ? y : high_y;
            }
            low_x_ = FourWide::least_of(low_x), high_x_ = -FourWide::least_of(-high_x);
            low_y_ = FourWide::least_of(low_y), high_y_ = -FourWide::least_of(-high_y);
        }
        // Of the second chain's places from `first` on, as many as there are lanes: a bit for each with which the triangle
        // may be turned over, wherever in their box the last chain's places are.
        UNSEEN_INLINE std::uint32_t suspect_sides(std::size_t at_a, std::size_t first) const {
            const float x = x_[0][at_a], y = y_[0][at_a];
            const Float4 to_x = lanes_of(x_[1], first) - x, to_y = lanes_of(y_[1], first) - y;
            const Float4 low = to_x * (low_y_ - y), high = to_x * (high_y_ - y), left = to_y * (low_x_ - x),
                         right = to_y * (high_x_ - x);
            const Float4 least = (low < high ? low : high) - (left < right ? right : left);
            return FourWide::bits_of(least > slack_) ^ 0xf; // NaN is suspect
        }
        // The same of the last chain's places; and those with which it is turned over for sure.
        struct Suspects {
            std::uint32_t all, turned;
        };
        UNSEEN_INLINE Suspects suspects(std::size_t at_a, std::size_t at_b, std::size_t first) const {
            const float x = x_[0][at_a], y = y_[0][at_a], to_x = x_[1][at_b] - x, to_y = y_[1][at_b] - y;
            const Float4 area = to_x * (lanes_of(y_[2], first) - y) - to_y * (lanes_of(x_[2], first) - x);
            return {FourWide::bits_of(area > slack_) ^ 0xf, FourWide::bits_of(area < -slack_)};
        }

    private:
        using Coordinates = std::array<float, longest_chain + lanes>;

        static UNSEEN_INLINE Float4 lanes_of(const Coordinates& values, std::size_t first) {
            Float4 some;
            std::memcpy(&some, &values[first], sizeof some);
            return some;
        }

        float slack_, low_x_, high_x_, low_y_, high_y_;
        std::array<Coordinates, 3> x_, y_;
    };

    struct Ways {
        std::array<Chain, 3> chains;
        Front in_space, in_texture;
        std::vector<Need> needs;
        std::size_t left = 0; // to try at the triangles to come
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
        std::vector<std::uint8_t> is_under(tree_.leaves());
        for (const NodeId node : nodes)
            std::fill(is_under.begin() + g_.first_leaf[node], is_under.begin() + g_.leaf_end[node], std::uint8_t{1});
        const auto is_near = [&](Index t) {
            return std::ranges::any_of(g_.triangles[t], [&](Index leaf) {
                if (!is_under[leaf]) return false;
                NodeId node = above_leaf_[leaf];
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

    TurnedTest::Positions positions_of(WedgeId u, WedgeId v, WedgeId w) const {
        return {g_.positions[u], g_.positions[v], g_.positions[w]};
    }
    TurnedTest::Uvs uvs_of(WedgeId u, WedgeId v, WedgeId w) const {
        return g_.uvs.empty() ? TurnedTest::Uvs{} : TurnedTest::Uvs{g_.uvs[u], g_.uvs[v], g_.uvs[w]};
    }

    void look_at(Index t, Ways& ways, Found& found) const {
        const auto& [u, v, w] = g_.triangles[t];
        const TurnedTest test(positions_of(first_leaf_ + u, first_leaf_ + v, first_leaf_ + w),
                              uvs_of(first_leaf_ + u, first_leaf_ + v, first_leaf_ + w));
        if (test.uv_area() != 0) look_at<true>(t, test, ways, found);
        else look_at<false>(t, test, ways, found);
    }
    template <bool is_mapped>
    void look_at(Index t, const TurnedTest& test, Ways& ways, Found& found) const {
        const Triangle& leaves = g_.triangles[t];
        const Chain &a = ways.chains[0], &b = ways.chains[1], &c = ways.chains[2];
        const auto on_texture = [&](WedgeId w) { return is_mapped ? glm::vec3(g_.uvs[w], 0) : glm::vec3(0); };
        Front::Aim in_space(g_.positions[first_leaf_ + leaves[0]], test.normal());
        Front::Aim in_texture(on_texture(first_leaf_ + leaves[0]), {0, 0, test.uv_area()});
        for (std::size_t k = 0; k < 3; ++k)
            find_chain(leaves[k], vanishes_at_[t], ways.chains[k], [&](std::size_t i, WedgeId w) {
                ways.in_space.put(k, i, in_space(g_.positions[w]));
                if (is_mapped) ways.in_texture.put(k, i, in_texture(on_texture(w)));
            });
        const std::size_t count = a.size * b.size * c.size;
        if (count == 1) return;
        ways.needs.clear();
        bool any = false;
        const auto is_turned = [&](WedgeId u, WedgeId v, WedgeId w) {
            if (test.is_turned(positions_of(u, v, w))) return true;
            return is_mapped && !(on_mirror_[u] | on_mirror_[v] | on_mirror_[w]) && test.is_mirrored(uvs_of(u, v, w));
        };
        const std::size_t before = found.impossible.size();
        const auto try_way = [&](std::size_t i, std::size_t j, std::size_t k, bool is_known = false) {
            if (!is_known && !is_turned(a.wedges[i], b.wedges[j], c.wedges[k])) return;
            if (!std::exchange(any, true))
                for (Chain& chain : ways.chains) find_orders(chain);
            prevent(ways.chains, {i, j, k}, ways.needs, found.impossible);
        };
        if (count <= ways.left) {
            ways.left -= count;
            ways.in_space.finish(ways.chains, in_space.farthest());
            if (is_mapped) ways.in_texture.finish(ways.chains, in_texture.farthest());
            try_suspects<is_mapped>(ways, try_way);
            std::reverse(found.impossible.begin() + static_cast<std::ptrdiff_t>(before), found.impossible.end());
        } else {
            std::array<std::size_t, 3> at{};
            do try_way(at[0], at[1], at[2]);
            while (go_up(ways.chains, at));
        }
        if (!any) return;
        keep_least(ways.needs);
        if (ways.needs.empty()) ways.needs.push_back({no_node, no_node});
        for (const Need& need : ways.needs) found.needs.push_back({t, need});
    }

    // From the largest nodes on: what these need covers most of what the others would.
    template <bool is_mapped, class TryWay>
    UNSEEN_INLINE static void try_suspects(const Ways& ways, TryWay&& try_way) {
        const Chain &a = ways.chains[0], &b = ways.chains[1], &c = ways.chains[2];
        const auto from_last = [](std::size_t first, std::uint32_t suspects, std::size_t size, auto&& f) {
            for (; suspects; suspects ^= std::bit_floor(suspects))
                if (const std::size_t at = first + static_cast<std::size_t>(std::bit_width(suspects)) - 1; at < size)
                    f(at);
        };
        for (std::size_t i = a.size; i-- > 0;)
            for (std::size_t j_end = (b.size + Front::lanes - 1) / Front::lanes; j_end-- > 0;) {
                std::uint32_t sides = ways.in_space.suspect_sides(i, j_end * Front::lanes);
                if (is_mapped) sides |= ways.in_texture.suspect_sides(i, j_end * Front::lanes);
                from_last(j_end * Front::lanes, sides, b.size, [&](std::size_t j) {
                    for (std::size_t k_end = (c.size + Front::lanes - 1) / Front::lanes; k_end-- > 0;) {
                        const std::size_t first = k_end * Front::lanes;
                        Front::Suspects found = ways.in_space.suspects(i, j, first);
                        if (is_mapped) found.all |= ways.in_texture.suspects(i, j, first).all;
                        from_last(first, found.all, c.size,
                                  [&](std::size_t k) { try_way(i, j, k, (found.turned >> (k - first) & 1) != 0); });
                    }
                });
            }
    }

    // To the next cut by size.
    bool go_up(const std::array<Chain, 3>& chains, std::array<std::size_t, 3>& at) const {
        std::size_t next = 0;
        for (std::size_t k = 1; k < 3; ++k)
            if (is_smaller(chains[k].nodes[at[k] + 1], chains[next].nodes[at[next] + 1])) next = k;
        return ++at[next] < chains[next].size;
    }

    bool is_above(NodeId node, NodeId below) const { return (node <= below) & (below < g_.subtree_end[node]); }

    // From the place up to what stands for two corners.
    // Calls f(i, wedge) for each.
    template <class F>
    UNSEEN_INLINE void find_chain(Index leaf, NodeId vanishes_at, Chain& chain, F&& f) const {
        NodeId node = no_node; // stands for the place, which no node needs
        std::size_t size = 0;
        const auto add = [&](WedgeId w) {
            chain.nodes[size] = node;
            chain.wedges[size] = w;
            f(size++, w);
        };
        add(first_leaf_ + leaf);
        node = above_leaf_[leaf];
        for (std::size_t step = 0; step < longest_chain && !is_above(node, vanishes_at); ++step) {
            if (!joins_[node]) add(wedge_at(node, leaf));
            node = g_.parents[node];
        }
        chain.nodes[size] = head_of(node);
        chain.size = size;
    }

    void find_orders(Chain& chain) const {
        for (std::size_t i = 0; i <= chain.size; ++i) chain.orders[i] = order_of(chain.nodes[i]);
    }

    // The largest one of three nodes shall be unfolded where the smaller ones are active and its parent is unfolded: by the
    // smallest of the next ones above the three.
    void prevent(const std::array<Chain, 3>& chains, const std::array<std::size_t, 3>& at, std::vector<Need>& needs,
                 std::vector<Need>& impossible) const {
        constexpr std::size_t most_compared = 4; // neighbouring ways mostly find the same
        const auto order = [&](std::size_t k) { return chains[k].orders[at[k]]; };
        const auto order_above = [&](std::size_t k) { return chains[k].orders[at[k] + 1]; };
        const auto above = [&](std::size_t k) { return chains[k].nodes[at[k] + 1]; };
        std::size_t large = order(0) < order(1) ? 1 : 0, other = 2;
        const std::size_t one = 1 - large;
        if (order(large) < order(2)) std::swap(large, other);
        const std::size_t least = order_above(one) < order_above(other) ? one : other;
        const NodeId needed = chains[large].nodes[at[large]];
        if (order_above(least) < order(large)) {
            const Need need{above(least), needed};
            for (std::size_t i = needs.size(); i-- > 0 && i + most_compared >= needs.size();)
                if (follows(need, needs[i])) return;
            needs.push_back(need);
        } else {
            impossible.push_back({above(order_above(large) < order_above(least) ? large : least), needed});
        }
    }

    // An unfolded node is under unfolded ones.
    bool follows(const Need& need, const Need& from) const {
        return need.needed == from.needed && is_above(from.node, need.node);
    }

    // By one number, then by the other.
    static void sort(std::vector<Need>& needs, NodeId Need::*first, NodeId Need::*second) {
        constexpr std::size_t few = 64;
        const auto key = [&](const Need& need) { return std::uint64_t{need.*first} << 32 | need.*second; };
        if (needs.size() < few) return std::ranges::sort(needs, {}, key), void();
        std::vector<CodedIndex> items(needs.size()), scratch(needs.size());
        for (std::size_t i = 0; i < needs.size(); ++i) items[i] = {key(needs[i]), 0};
        sort_by_code(items, scratch);
        for (std::size_t i = 0; i < needs.size(); ++i) {
            needs[i].*first = static_cast<NodeId>(items[i].code >> 32);
            needs[i].*second = static_cast<NodeId>(items[i].code);
        }
    }

    // Without those that follow from another one.
    void keep_least(std::vector<Need>& needs) const {
        if (needs.size() < 2) return;
        sort(needs, &Need::needed, &Need::node);
        std::size_t kept = 1; // ancestors come first
        for (const Need& need : needs)
            if (!follows(need, needs[kept - 1])) needs[kept++] = need;
        needs.resize(kept);
    }

    NeedArrays<Vector> arrays_of(std::vector<Need> needs) const {
        NeedArrays<Vector> arrays;
        if (needs.empty()) return arrays;
        keep_least(needs);
        sort(needs, &Need::node, &Need::needed);
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
    std::vector<std::uint64_t> order_; // by interior node: sizes first, and behind parents
    std::vector<std::uint8_t> joins_;  // by interior node: folds and unfolds with its parent
    std::vector<NodeId> vanishes_at_;  // by triangle
    const WedgeId first_leaf_;
    std::vector<NodeId> above_leaf_; // by leaf: its place's parent
    static constexpr WedgeId several_wedges = ~WedgeId{0};
    std::vector<WedgeId> wedge_of_node_;  // by interior node; empty where each has its own number
    std::vector<std::uint8_t> on_mirror_; // by wedge; empty without uvs
};

} // namespace

NeedArrays<Vector> find_needs(const TreeGeometry& geometry) { return NeedFinder(geometry).find(); }

} // namespace unseen::vdtree
