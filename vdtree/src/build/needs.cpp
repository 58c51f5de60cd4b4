#include "build/needs.h"

#include <algorithm>
#include <bit>
#include <utility>

#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/simd.h>
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

    // Where a triangle is seen from its front, and likewise in the texture: its corners' chains in floats. Mostly no way
    // turns it over, and this takes less than the tests themselves.
    class Front {
    public:
        static constexpr std::size_t lanes = 4;

        // place_of(stand): two coordinates of up to 2, in which the triangle itself runs counter-clockwise.
        template <class PlaceOf>
        void set(const std::array<Chain, 3>& chains, PlaceOf&& place_of) {
            for (std::size_t k = 0; k < 3; ++k)
                for (std::size_t i = 0; i < (chains[k].size() + lanes - 1) / lanes * lanes; ++i) {
                    const glm::vec2 p = place_of(chains[k][std::min(i, chains[k].size() - 1)]);
                    x_[k][i] = p.x, y_[k][i] = p.y;
                }
        }
        // Of the stands of the last chain from `first` on, as many as there are lanes: a bit for each where the triangle may
        // be turned over.
        std::uint32_t suspects(std::size_t at_a, std::size_t at_b, std::size_t first) const {
            constexpr float slack = 2e-5f; // of the area; roundings are below 2e-6
            const float x = x_[0][at_a], y = y_[0][at_a], to_x = x_[1][at_b] - x, to_y = y_[1][at_b] - y;
            Float4 x_of_c, y_of_c;
            std::memcpy(&x_of_c, &x_[2][first], sizeof x_of_c);
            std::memcpy(&y_of_c, &y_[2][first], sizeof y_of_c);
            return FourWide::bits_of(to_x * (y_of_c - y) - to_y * (x_of_c - x) > slack) ^ 0xf; // NaN is suspect
        }

    private:
        std::array<std::array<float, longest_chain + lanes>, 3> x_, y_;
    };

    struct Ways {
        std::array<Chain, 3> chains;
        Front in_space, in_texture;
        std::vector<Need> needs;
        std::size_t left = 0; // to try at the triangles to come
    };

    // Brings all stands within 1 of the first corner's. Not finite where floats are too coarse: then all are suspect.
    template <class Value>
    static float scale_of(const std::array<Chain, 3>& chains, Value Stand::*value) {
        float squared = 0;
        for (const Chain& chain : chains)
            for (const Stand& stand : chain) {
                const Value way = stand.*value - chains[0][0].*value;
                squared = std::max(squared, glm::dot(way, way));
            }
        return 1 / std::sqrt(squared);
    }
    // Along the triangle's normal onto the plane of two axes, relative to the first corner.
    static void show(const std::array<Chain, 3>& chains, const glm::dvec3& normal, Front& front) {
        const glm::vec3 origin = chains[0][0].position;
        const float scale = scale_of(chains, &Stand::position);
        const glm::dvec3 size(std::fabs(normal.x), std::fabs(normal.y), std::fabs(normal.z));
        const int axis = size.x > size.y ? (size.x > size.z ? 0 : 2) : (size.y > size.z ? 1 : 2);
        const int u = normal[axis] > 0 ? (axis + 1) % 3 : (axis + 2) % 3, v = 3 - axis - u;
        const double by = static_cast<double>(scale) / normal[axis];
        const float u_by = static_cast<float>(normal[u] * by), v_by = static_cast<float>(normal[v] * by);
        front.set(chains, [&](const Stand& stand) {
            const glm::vec3 p = stand.position - origin;
            return glm::vec2(p[u] * scale - p[axis] * u_by, p[v] * scale - p[axis] * v_by);
        });
    }
    static void show_texture(const std::array<Chain, 3>& chains, bool is_mirrored, Front& front) {
        const glm::vec2 origin = chains[0][0].uv;
        const float scale = scale_of(chains, &Stand::uv);
        front.set(chains, [&](const Stand& stand) {
            const glm::vec2 p = (stand.uv - origin) * scale;
            return is_mirrored ? glm::vec2(p.y, p.x) : p;
        });
    }

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
        std::vector<std::uint8_t> is_under(is_one);
        for (NodeId node = 1; node < tree_.interior(); ++node) is_under[node] |= is_under[g_.parents[node]];
        const auto is_near = [&](Index t) {
            return std::ranges::any_of(g_.triangles[t], [&](Index leaf) {
                NodeId node = g_.parents[tree_.place_of_leaf(leaf)];
                if (!is_under[node]) return false;
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
            show(ways.chains, test.normal(), ways.in_space);
            const bool is_mapped = test.uv_area() != 0;
            if (is_mapped) show_texture(ways.chains, test.uv_area() < 0, ways.in_texture);
            for (std::size_t i = 0; i < a.size(); ++i)
                for (std::size_t j = 0; j < b.size(); ++j)
                    for (std::size_t first = 0; first < c.size(); first += Front::lanes) {
                        std::uint32_t suspects = ways.in_space.suspects(i, j, first);
                        if (is_mapped) suspects |= ways.in_texture.suspects(i, j, first);
                        for (; suspects; suspects &= suspects - 1) {
                            const std::size_t k = first + static_cast<std::size_t>(std::countr_zero(suspects));
                            if (k < c.size()) try_way(a[i], b[j], c[k]);
                        }
                    }
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
        if (const Need need{above, large->node}; is_smaller(need.node, need.needed)) {
            if (needs.empty() || needs.back() != need) needs.push_back(need); // neighbouring ways mostly find the same
            return;
        }
        if (is_smaller(large->above, above)) above = large->above;
        impossible.push_back({above, large->node});
    }

    // Without those that follow from another one, for an unfolded node is under unfolded ones.
    void keep_least(std::vector<Need>& needs) const {
        std::ranges::sort(needs, {}, [](const Need& need) { return std::uint64_t{need.needed} << 32 | need.node; });
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
