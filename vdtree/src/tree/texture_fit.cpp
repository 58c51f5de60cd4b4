#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/texture_fit.h>

#include <algorithm>

#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/texture_bounds.h>

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
    const NodeId interior = tree.interior();
    std::vector<Moments> around(tree.leaves()), sums(interior);
    // Around each leaf's own coordinates, lest small rings far from 0 lose their digits: moved to the parent's where
    // they are summed.
    const auto add = [&](Moments& to, const glm::vec2& uv0, const glm::vec3& p0, NodeId vertex) {
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
                        add(around[leaf], g.uvs[interior + leaf], g.positions[interior + leaf], interior + corner);
        };
    });
    maps_.resize(interior);
    parts.bottom_up([&] {
        return [&](NodeId node) {
            const glm::dvec2 uv0(g.uvs[node]);
            const glm::dvec3 p0(g.positions[node]);
            Moments sum;
            const auto take = [&](const Moments& m, NodeId vertex) {
                sum += moved(m, glm::dvec2(g.uvs[vertex]) - uv0, glm::dvec3(g.positions[vertex]) - p0);
            };
            tree.for_each_child(
                node, [&](NodeId child) { take(sums[child], child); },
                [&](Index leaf) { take(around[leaf], interior + leaf); });
            sums[node] = sum;

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
            maps_[node] = map;
        };
    });
    moves_ = find_texture_moves(g, parts);
}

std::vector<glm::vec2> TextureFits::fitted_uvs(const std::vector<UvBox>& footprints) const {
    std::vector<glm::vec2> uvs(g_->uvs.begin(), g_->uvs.end());
    parallel_loop(std::size_t{0}, maps_.size(), [&](std::size_t node) {
        const Map& map = maps_[node];
        if (!moves_[node]) return;
        const double uu = glm::dot(map.along_u, map.along_u), uv = glm::dot(map.along_u, map.along_v),
                     vv = glm::dot(map.along_v, map.along_v);
        const double determinant = uu * vv - uv * uv;
        if (!(determinant > least_determinant * uu * vv)) return;
        const glm::dvec3 off = glm::dvec3(g_->positions[node]) - map.at;
        const double u = glm::dot(off, map.along_u), v = glm::dot(off, map.along_v);
        const glm::vec2 fitted((u * vv - v * uv) / determinant, (v * uu - u * uv) / determinant);
        for (int k = 0; k < 2; ++k) // NaN leaves what there is
            if (fitted[k] >= -std::numeric_limits<float>::max())
                uvs[node][k] = std::clamp(fitted[k], footprints[node].lo[k], footprints[node].hi[k]);
    });
    return uvs;
}

double TextureFits::residual_of_subtree(NodeId node) const {
    // Trees are some tens of nodes deep, and each node looks at all below: where one is far deeper, nobody pays for the
    // square of that.
    constexpr NodeId most_ancestors = 256;
    NodeId ancestors = 0;
    for (NodeId above = g_->parents[node]; above != no_node; above = g_->parents[above])
        if (++ancestors > most_ancestors) return std::numeric_limits<double>::infinity();
    const NodeId interior = static_cast<NodeId>(g_->first_leaf.size());
    double largest = 0;
    for (NodeId below = node; below < g_->subtree_end[node]; ++below)
        largest = std::max(largest, residual(node, below));
    for (Index leaf = g_->first_leaf[node]; leaf < g_->leaf_end[node]; ++leaf)
        largest = std::max(largest, residual(node, interior + leaf));
    return largest;
}

} // namespace unseen::vdtree
