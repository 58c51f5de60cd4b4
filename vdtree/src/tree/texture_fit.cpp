#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/texture_fit.h>

#include <algorithm>

#include <glm/geometric.hpp>

namespace unseen::vdtree {

namespace {

// Sums over vertices, from which least squares follow.
struct Moments {
    double count = 0, u = 0, v = 0, uu = 0, uv = 0, vv = 0;
    glm::dvec3 p{0}, pu{0}, pv{0};

    void add(glm::dvec2 at, glm::dvec3 position) {
        count += 1;
        u += at.x, v += at.y, uu += at.x * at.x, uv += at.x * at.y, vv += at.y * at.y;
        p += position, pu += at.x * position, pv += at.y * position;
    }
    Moments& operator+=(const Moments& o) {
        count += o.count;
        u += o.u, v += o.v, uu += o.uu, uv += o.uv, vv += o.vv;
        p += o.p, pu += o.pu, pv += o.pv;
        return *this;
    }
};

// Where coordinates differ by less than this share of themselves in some direction, no direction of the surface
// follows.
constexpr double least_determinant = 1e-12;

} // namespace

TextureFits::TextureFits(const TreeGeometry& g, const TreeParts& parts) : g_(&g) {
    const TreeLinks tree = links_of(g);
    const WedgeId first = tree.wedge_of_leaf(0);
    std::vector<Moments> around(tree.leaves()), sums(first);
    // Around each leaf's own coordinates, lest small rings far from 0 lose their digits: moved to the parent's where
    // they are summed.
    const auto add = [&](Moments& to, const glm::vec2& uv0, const glm::vec3& p0, WedgeId vertex) {
        to.add(glm::dvec2(g.uvs[vertex]) - glm::dvec2(uv0), glm::dvec3(g.positions[vertex]) - glm::dvec3(p0));
    };
    const auto moved = [](const Moments& m, glm::dvec2 by, glm::dvec3 off) { // coordinates and positions grow by these
        Moments n = m;
        n.u = m.u + by.x * m.count, n.v = m.v + by.y * m.count;
        n.uu = m.uu + 2 * by.x * m.u + by.x * by.x * m.count;
        n.vv = m.vv + 2 * by.y * m.v + by.y * by.y * m.count;
        n.uv = m.uv + by.x * m.v + by.y * m.u + by.x * by.y * m.count;
        n.p = m.p + off * m.count;
        n.pu = m.pu + by.x * m.p + off * m.u + off * (by.x * m.count);
        n.pv = m.pv + by.y * m.p + off * m.v + off * (by.y * m.count);
        return n;
    };
    parts.for_each_triangle([&](const TreePart& part) {
        return [&](Index triangle) {
            const Triangle& t = g.triangles[triangle];
            for (const Index leaf : t)
                if (parts.owns_leaf(part, leaf))
                    for (const Index corner : t)
                        add(around[leaf], g.uvs[first + leaf], g.positions[first + leaf], first + corner);
        };
    });
    maps_.resize(first);
    moves_.assign(tree.interior(), 0);
    const auto fit = [&](WedgeId wedge, const Moments& sum) {
        const glm::dvec2 uv0(g.uvs[wedge]);
        const glm::dvec3 p0(g.positions[wedge]);
        const double n = sum.count, uu = sum.uu - sum.u * sum.u / n, uv = sum.uv - sum.u * sum.v / n,
                     vv = sum.vv - sum.v * sum.v / n;
        const double determinant = uu * vv - uv * uv;
        const glm::dvec3 pu = sum.pu - sum.p * (sum.u / n), pv = sum.pv - sum.p * (sum.v / n);
        Map map{sum.p / n, glm::dvec3(0), glm::dvec3(0)};
        if (determinant > least_determinant * uu * vv) {
            map.along_u = (pu * vv - pv * uv) / determinant;
            map.along_v = (pv * uu - pu * uv) / determinant;
        }
        map.at = p0 + map.at - (sum.u / n + uv0.x) * map.along_u - (sum.v / n + uv0.y) * map.along_v;
        maps_[wedge] = map;
    };
    parts.bottom_up([&] {
        return [&](NodeId node) {
            const auto take = [&](const Moments& m, WedgeId vertex) {
                const WedgeId to = tree.wedge_above(node, vertex);
                sums[to] += moved(m, glm::dvec2(g.uvs[vertex]) - glm::dvec2(g.uvs[to]),
                                  glm::dvec3(g.positions[vertex]) - glm::dvec3(g.positions[to]));
                moves_[node] |= g.uvs[vertex] != g.uvs[to];
            };
            tree.for_each_child(
                node,
                [&](NodeId child) {
                    moves_[node] |= moves_[child];
                    for (WedgeId w = tree.first_wedge_of(child); w < tree.first_wedge_of(child + 1); ++w)
                        take(sums[w], w);
                },
                [&](Index leaf) { take(around[leaf], first + leaf); });
            for (WedgeId w = tree.first_wedge_of(node); w < tree.first_wedge_of(node + 1); ++w) fit(w, sums[w]);
        };
    });
}

double TextureFits::residual_of_subtree(NodeId node) const {
    // Trees are some tens of nodes deep, and each node looks at all below: where one is far deeper, nobody pays for the
    // square of that.
    constexpr NodeId most_ancestors = 256;
    NodeId ancestors = 0;
    for (NodeId above = g_->parents[node]; above != no_node; above = g_->parents[above])
        if (++ancestors > most_ancestors) return std::numeric_limits<double>::infinity();
    const TreeLinks tree = links_of(*g_);
    double largest = 0;
    const auto look_at = [&](WedgeId begin, WedgeId end) {
        for (WedgeId w = begin; w < end; ++w) largest = std::max(largest, residual(tree.wedge_above(node, w), w));
    };
    look_at(tree.first_wedge_of(node), tree.first_wedge_of(g_->subtree_end[node]));
    look_at(tree.wedge_of_leaf(g_->first_leaf[node]), tree.wedge_of_leaf(g_->leaf_end[node]));
    return largest;
}

} // namespace unseen::vdtree
