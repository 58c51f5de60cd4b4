// The triangles around a node before and after its fold, how far its neighbours are folded by then, and the nearest
// points of such surfaces to given points.
#pragma once

#include <algorithm>
#include <cmath>
#include <iterator>

#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/normal_mask.h>
#include <unseen/vdtree/vertex_tree.h>

#include "measure/fold_picture.h"
#include "measure/registers.h"

namespace unseen::perception {

// A triangle of a ring before or after the fold, with this many luminances at each corner.
template <std::size_t count>
struct RingTriangle {
    LitPointOf<count> corner[3];
    unsigned inside = 0; // a bit for each corner in the support
    unsigned sheet = 0;  // which of the node's wedges these corners fold into
};

// Points by columns, so that a surface is compared with eight at once, and the nearest points of that surface.
template <std::size_t count>
class ComparedPoints {
public:
    using Point = LitPointOf<count>;
    static constexpr std::size_t lanes = 8;

    void clear() { points_.clear(), sheets_.clear(); }
    void add(const Point& p, unsigned sheet) { points_.push_back(p), sheets_.push_back(static_cast<float>(sheet)); }
    std::size_t size() const { return points_.size(); }

    // Columns of the points from `first` on; after the last point it is repeated.
    struct alignas(32) Block {
        float x[lanes], y[lanes], z[lanes], sheet[lanes];
        float squared[lanes], luminance[count][lanes]; // the distance to the nearest point, and its luminances
    };
    std::span<Block> blocks() {
        blocks_.resize((size() + lanes - 1) / lanes);
        for (std::size_t i = 0; i < blocks_.size() * lanes; ++i) {
            const std::size_t point = std::min(i, size() - 1);
            const glm::vec3& p = points_[point].position;
            Block& to = blocks_[i / lanes];
            to.x[i % lanes] = p.x, to.y[i % lanes] = p.y, to.z[i % lanes] = p.z;
            to.sheet[i % lanes] = sheets_[point];
        }
        return blocks_;
    }
    // Once the blocks are compared: the distance to the nearest point, and what is here and there.
    float distance(std::size_t i) const { return std::sqrt(blocks_[i / lanes].squared[i % lanes]); }
    std::array<float, count> here(std::size_t i) const {
        std::array<float, count> all;
        for (std::size_t k = 0; k < count; ++k) all[k] = points_[i].luminance[k];
        return all;
    }
    std::array<float, count> there(std::size_t i) const {
        std::array<float, count> all;
        for (std::size_t k = 0; k < count; ++k) all[k] = blocks_[i / lanes].luminance[k][i % lanes];
        return all;
    }

private:
    std::vector<Point> points_;
    std::vector<float> sheets_; // of RingTriangle
    std::vector<Block> blocks_;
};

template <std::size_t count>
class Surface {
public:
    using Block = typename ComparedPoints<count>::Block;

    void assign(std::span<const RingTriangle<count>> ring, std::span<const RingTriangle<count>> around = {}) {
        triangles_.clear();
        add(ring);
        add(around);
    }
    void add(std::span<const RingTriangle<count>> ring) {
        for (const auto& [corner, inside, sheet] : ring) {
            std::size_t first = 0;
            Products products(corner, first);
            // At the tip of a sliver, its two long edges are almost one: rounding would move points along them.
            if (!(products.determinant() > sharp_tip * products.bb * products.cc)) {
                first = widest_corner(corner);
                products = Products(corner, first);
            }
            const auto &a = corner[first], &b = corner[(first + 1) % 3], &c = corner[(first + 2) % 3];
            const auto& [ab, ac, bb, bc, cc] = products;
            const float determinant = products.determinant();
            PreparedTriangle& t = triangles_.emplace_back();
            t.a = a.position, t.b = ab, t.c = ac;
            t.bb = bb, t.bc = bc, t.cc = cc;
            t.sheet = static_cast<float>(sheet);
            t.along_b = divisor(bb), t.along_c = divisor(cc), t.along_bc = divisor(bb - 2 * bc + cc);
            t.inverse = determinant > least_determinant * bb * cc ? 1 / determinant : 0;
            for (std::size_t i = 0; i < count; ++i) {
                t.luminance[i] = a.luminance[i];
                t.luminance_b[i] = b.luminance[i] - a.luminance[i], t.luminance_c[i] = c.luminance[i] - a.luminance[i];
            }
        }
    }
    bool empty() const { return triangles_.empty(); }

    // How the points differ from the nearest ones of the surface; of equally near ones, those of the first triangle.
    // `aside`: 0, or a length. A point of another sheet must be nearer than the nearest one of a point's own, about by
    // this much, to count: where sheets meet, at a seam, both are equally near.
    void compare(ComparedPoints<count>& points, float aside) const {
        const float squared = aside * aside;
        for (Block& block : points.blocks())
            on_widest([&]<class Floats>() UNSEEN_INLINE_LAMBDA {
                for (std::size_t first = 0; first < ComparedPoints<count>::lanes; first += width_of<Floats>) {
                    if (squared > 0) find<Floats, true>(triangles_, block, first, squared);
                    else find<Floats, false>(triangles_, block, first, 0);
                }
            });
    }

private:
    static constexpr float infinitely_far = std::numeric_limits<float>::infinity();
    // Triangles whose area is less than a thousandth of their edges' squares count by their edges.
    static constexpr float least_determinant = 1e-6f;
    static constexpr float sharp_tip = 1e-3f; // squared sine of an angle, of 1.8 degrees

    // Of the edges from a corner.
    struct Products {
        glm::vec3 b, c;
        float bb, bc, cc;

        Products(const LitPointOf<count> (&corner)[3], std::size_t from)
            : b(corner[(from + 1) % 3].position - corner[from].position),
              c(corner[(from + 2) % 3].position - corner[from].position), bb(glm::dot(b, b)), bc(glm::dot(b, c)),
              cc(glm::dot(c, c)) {}
        float determinant() const { return bb * cc - bc * bc; }
    };
    // That of the largest angle, opposite to the longest edge.
    static std::size_t widest_corner(const LitPointOf<count> (&corner)[3]) {
        std::size_t widest = 0;
        float longest = -1;
        for (std::size_t k = 0; k < 3; ++k) {
            const glm::vec3 opposite = corner[(k + 2) % 3].position - corner[(k + 1) % 3].position;
            if (const float squared = glm::dot(opposite, opposite); squared > longest) longest = squared, widest = k;
        }
        return widest;
    }

    struct PreparedTriangle {
        glm::vec3 a, b, c;                                            // b and c from a
        std::array<float, count> luminance, luminance_b, luminance_c; // a's; the others' less that
        float bb, bc, cc, sheet;                                      // products
        float along_b, along_c, along_bc;                             // what lengths along the edges are divided by
        float inverse;                                                // of the determinant; 0: only its edges count
    };
    // On an edge without a length, the first end is as near as any point.
    static float divisor(float squared) { return squared > 0 ? squared : infinitely_far; }

    // The nearest point a + v b + w c of each triangle: of its inside, where the foot of the perpendicular lies there,
    // or of an edge. `Floats`: a register's.
    template <class Floats, bool has_sheets>
    static UNSEEN_INLINE void find(std::span<const PreparedTriangle> triangles, Block& points, std::size_t first,
                                   float squared_aside) {
        const auto share = [](const Floats& part, float whole) UNSEEN_INLINE_LAMBDA {
            const Floats s = part / whole, above = s > 0 ? s : Floats{};
            return above < 1 ? above : Floats{} + 1;
        };
        const Floats x = floats_at<Floats>(points.x + first), y = floats_at<Floats>(points.y + first),
                     z = floats_at<Floats>(points.z + first), sheet = floats_at<Floats>(points.sheet + first);
        Floats nearest = Floats{} + infinitely_far, nearest_cost = nearest, nearest_luminance[count] = {};
        for (const PreparedTriangle& t : triangles) {
            const Floats px = x - t.a.x, py = y - t.a.y, pz = z - t.a.z;
            const Floats pb = px * t.b.x + py * t.b.y + pz * t.b.z, pc = px * t.c.x + py * t.c.y + pz * t.c.z;
            const Floats v0 = (t.cc * pb - t.bc * pc) * t.inverse, w0 = (t.bb * pc - t.bc * pb) * t.inverse;
            const Floats on_ab = share(pb, t.along_b), on_ac = share(pc, t.along_c),
                         on_bc = share(pc - pb - t.bc + t.bb, t.along_bc), off_bc = 1 - on_bc;
            const Floats cost_ab = on_ab * (on_ab * t.bb - 2 * pb), cost_ac = on_ac * (on_ac * t.cc - 2 * pc),
                         cost_bc =
                             off_bc * (off_bc * t.bb + 2 * on_bc * t.bc - 2 * pb) + on_bc * (on_bc * t.cc - 2 * pc);
            const auto is_ab = cost_ab < cost_ac;
            const auto is_bc = cost_bc < (is_ab ? cost_ab : cost_ac);
            const auto is_inside = (Floats{} + t.inverse > 0) & (v0 >= 0) & (w0 >= 0) & (v0 + w0 <= 1);
            Floats v = is_ab ? on_ab : Floats{}, w = is_ab ? Floats{} : on_ac;
            v = is_bc ? off_bc : v;
            w = is_bc ? on_bc : w;
            v = is_inside ? v0 : v;
            w = is_inside ? w0 : w;
            const Floats dx = px - v * t.b.x - w * t.c.x, dy = py - v * t.b.y - w * t.c.y,
                         dz = pz - v * t.b.z - w * t.c.z;
            const Floats squared = dx * dx + dy * dy + dz * dz;
            Floats cost = squared;
            if constexpr (has_sheets) cost += sheet == t.sheet ? Floats{} : Floats{} + squared_aside;
            const auto is_nearer = cost < nearest_cost;
            nearest = is_nearer ? squared : nearest;
            nearest_cost = is_nearer ? cost : nearest_cost;
            for (std::size_t i = 0; i < count; ++i) {
                const Floats luminance = t.luminance[i] + v * t.luminance_b[i] + w * t.luminance_c[i];
                nearest_luminance[i] = is_nearer ? luminance : nearest_luminance[i];
            }
        }
        store(nearest, points.squared + first);
        for (std::size_t i = 0; i < count; ++i) store(nearest_luminance[i], points.luminance[i] + first);
    }
    std::vector<PreparedTriangle> triangles_;
};

// Neighbours are folded where any of the trees' luminances says so, or where all of them do.
enum class Says { any, all };

template <std::size_t luminances>
class FoldNeighbours {
    using Index = vdtree::Index;
    using NodeId = vdtree::NodeId;

public:
    // `trees`: the same except for their luminances.
    explicit FoldNeighbours(std::span<const vdtree::SoundTree> trees)
        : tree_(trees.front()), first_leaf_(tree_.first_leaf()), leaf_end_(tree_.leaf_end()), parents_(tree_.parents()),
          support_(tree_.support_spheres()), luminance_span_(tree_.interior_count()),
          most_changed_(tree_.interior_count()) {
        for (NodeId node = 0; node < tree_.interior_count(); ++node) {
            for (std::size_t i = 0; i < luminances; ++i) {
                const vdtree::PackedRange support = trees[i].support_luminance()[node];
                luminance_span_[node][i] = support.hi.value - support.lo.value;
            }
            most_changed_[node] = most_changed(node, trees);
        }
    }

    // The node that stands for a leaf outside of `node`. Nodes up to its size are folded unless they have more to hide,
    // and so are nodes of any size that hardly anybody sees fold, such as the faces beside an edge.
    NodeId stand_in(Index leaf, NodeId node, Says says) const {
        NodeId at = tree_.place_of_leaf(leaf);
        const auto folds_earlier = [&](NodeId up) {
            const bool is_smaller = is_larger(node, up);
            for (std::size_t i = 0; i < luminances; ++i) {
                const bool so =
                    (is_smaller && luminance_span_[up][i] <= measurement::much_more * luminance_span_[node][i]) ||
                    (changes_much_less(up, node, i) && !supports(up, node));
                if (so == (says == Says::any)) return so;
            }
            return says == Says::all;
        };
        int steps = 0;
        for (NodeId up = parents_[at]; up != vdtree::no_node && folds_earlier(up) && ++steps <= measurement::most_steps;
             up = parents_[at])
            at = up;
        return at;
    }

private:
    bool is_larger(NodeId a, NodeId b) const { // ancestors are larger than their descendants
        return support_[a].radius != support_[b].radius ? support_[a].radius > support_[b].radius : a < b;
    }

    // The most that a fold inside the surface can change, up to a factor: luminance times area, and heights. Neither
    // falls from a node to its parent.
    struct Change {
        std::array<float, luminances> light = {};
        float height = 0;
    };
    Change most_changed(NodeId node, std::span<const vdtree::SoundTree> trees) const {
        const vdtree::NormalSlabs& normals = tree_.bounds()[node].slabs;
        int turn = 0; // by which the normals differ
        for (std::size_t i = 0; i < vdtree::NormalSlabs::axis_count; ++i)
            turn = std::max(turn, normals.hi[i] - normals.lo[i]);
        const float radius = support_[node].radius;
        Change change{{}, static_cast<float>(turn) * radius};
        for (std::size_t i = 0; i < luminances; ++i) {
            const vdtree::PackedRange luminance = trees[i].ring_luminance()[node];
            change.light[i] = static_cast<float>(luminance.hi.value - luminance.lo.value) * radius * radius;
        }
        return change;
    }
    bool changes_much_less(NodeId a, NodeId node, std::size_t luminance) const {
        const Change &less = most_changed_[a], &more = most_changed_[node];
        return measurement::much_less * less.light[luminance] <= more.light[luminance] &&
               measurement::much_less * less.height <= more.height &&
               !(tree_.bounds()[a].flags & vdtree::irregular_ring); // whose border may move as far as it likes
    }
    bool supports(NodeId a, NodeId b) const { return first_leaf_[a] <= first_leaf_[b] && leaf_end_[b] <= leaf_end_[a]; }

    const vdtree::SoundTree& tree_;
    std::span<const Index> first_leaf_, leaf_end_;
    std::span<const NodeId> parents_;
    std::span<const vdtree::Sphere> support_;
    std::vector<std::array<int, luminances>> luminance_span_; // of the support, by interior node
    std::vector<Change> most_changed_;                        // likewise
};

// The directions that triangles face.
class NormalReach {
public:
    template <std::size_t channels>
    void insert(const RingTriangle<channels>& t) {
        const glm::vec3 a = t.corner[0].position;
        glm::vec3 n = glm::cross(t.corner[1].position - a, t.corner[2].position - a);
        const float squared = glm::dot(n, n);
        if (!(squared > 0)) return;
        n /= std::sqrt(squared);
        const auto along = vdtree::along_slab_axes(n.x, n.y, n.z);
        for (std::size_t i = 0; i < along.size(); ++i)
            low_[i] = std::min(low_[i], along[i]), high_[i] = std::max(high_[i], along[i]);
    }
    vdtree::NormalSlabs slabs() const {
        constexpr float margin = 1e-3f; // a hundred times the rounding of a normal
        return low_[0] > high_[0] ? vdtree::NormalSlabs() : vdtree::slabs_between(low_, high_, margin);
    }

private:
    vdtree::SlabCoordinates<float> low_ = {2, 2, 2, 2, 2, 2, 2}, high_ = {-2, -2, -2, -2, -2, -2, -2};
};

// The triangles with a corner in a node's support: with the neighbours folded that are folded by then, and with none.
template <std::size_t channels>
struct Ring {
    std::vector<RingTriangle<channels>> before, after, fine_before, fine_after;
    std::vector<RingTriangle<channels>> around, fine_around; // see add_surroundings()
    std::vector<vdtree::NodeId> shown;                       // corners of the crossing triangles, folded
    struct Child {
        vdtree::Index first_leaf;
        vdtree::NodeId node;
    };
    std::vector<Child> children;

    void clear() {
        for (auto* surface : {&before, &after, &fine_before, &fine_after, &around, &fine_around}) surface->clear();
        shown.clear();
        children.clear();
    }
};

inline bool are_distinct(const std::array<vdtree::NodeId, 3>& nodes) {
    return nodes[0] != nodes[1] && nodes[1] != nodes[2] && nodes[2] != nodes[0];
}

// Lays out the ring of a node; returns what its triangles face. `points`: of all wedges. `crossing`: triangles with a
// corner in the support that the children, folded, leave. `stand_in`: the node that stands for a leaf outside.
template <std::size_t channels, class StandIn>
NormalReach lay_out(const vdtree::SoundTree& tree, std::span<const LitPointOf<channels>> points, vdtree::NodeId node,
                    std::span<const vdtree::Index> crossing, const StandIn& stand_in, Ring<channels>& ring) {
    using vdtree::Index, vdtree::NodeId;
    using Child = typename Ring<channels>::Child;
    using vdtree::WedgeId;
    const WedgeId first_wedge = tree.first_wedge(node), leaves = tree.interior_wedge_count();
    const std::span<const vdtree::Triangle> triangles = tree.triangles();
    const std::span<const Index> first_leaf = tree.first_leaf();
    const Index first_vanishing = tree.first_triangle()[node], end_vanishing = tree.first_triangle()[node + 1];
    const Index begin = first_leaf[node], end = tree.leaf_end()[node];
    const auto is_inside = [&](Index leaf) { return leaf - begin < end - begin; };
    ring.clear();
    std::vector<Child>& children = ring.children;
    tree.for_each_child(node, [&](NodeId child) {
        children.push_back({tree.is_place(child) ? tree.first_wedge(child) - leaves : first_leaf[child], child});
    });
    const auto child_of = [&](Index leaf) {
        const auto after = std::upper_bound(children.begin(), children.end(), leaf,
                                            [](Index l, const Child& child) { return l < child.first_leaf; });
        return std::prev(after)->node;
    };
    NormalReach turned;
    const auto add = [&](std::vector<RingTriangle<channels>>& surface, const RingTriangle<channels>& t) {
        surface.push_back(t);
        turned.insert(t);
    };
    for (const Index t : crossing) {
        RingTriangle<channels> whole, before, after;
        std::array<NodeId, 3> shown, shown_before;
        whole.inside = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            const Index leaf = triangles[t][k];
            const bool is_here = is_inside(leaf);
            whole.corner[k] = points[leaves + leaf];
            whole.inside |= static_cast<unsigned>(is_here) << k;
            shown[k] = is_here ? node : stand_in(leaf);
            shown_before[k] = is_here ? child_of(leaf) : shown[k];
            const WedgeId wedge = tree.wedge_at(shown[k], leaf);
            if (is_here) whole.sheet = wedge - first_wedge; // one for all corners here, which the triangle joins
            before.corner[k] = points[is_here ? tree.wedge_at(shown_before[k], leaf) : wedge];
            after.corner[k] = points[wedge];
        }
        before.inside = after.inside = whole.inside, before.sheet = after.sheet = whole.sheet;
        ring.shown.insert(ring.shown.end(), shown.begin(), shown.end());
        turned.insert(whole);
        if (are_distinct(shown_before)) add(ring.before, before);
        RingTriangle<channels> fine_before = whole;
        std::array<NodeId, 3> shown_fine = shown_before;
        for (std::size_t k = 0; k < 3; ++k) {
            if ((whole.inside >> k) & 1) fine_before.corner[k] = before.corner[k];
            else shown_fine[k] = tree.place_of_leaf(triangles[t][k]);
        }
        if (are_distinct(shown_fine)) ring.fine_before.push_back(fine_before);
        if (t >= first_vanishing && t < end_vanishing) continue; // vanishes here
        RingTriangle<channels> fine = whole;
        for (std::size_t k = 0; k < 3; ++k)
            if ((whole.inside >> k) & 1) fine.corner[k] = after.corner[k];
        add(ring.fine_after, fine);
        if (are_distinct(shown)) add(ring.after, after);
    }
    return turned;
}

// Adds to a ring that was laid out the triangles next to it, which the fold leaves alone: where one of the ring's is turned
// over, the ring lies over these. `triangles_at`: those at a place. None where the neighbours have too many.
template <std::size_t channels, class StandIn, class TrianglesAt>
void add_surroundings(const vdtree::SoundTree& tree, std::span<const LitPointOf<channels>> points, vdtree::NodeId node,
                      std::span<const vdtree::Index> crossing, const StandIn& stand_in, const TrianglesAt& triangles_at,
                      Ring<channels>& ring) {
    using vdtree::Index, vdtree::NodeId;
    const std::span<const vdtree::Triangle> triangles = tree.triangles();
    const Index begin = tree.first_leaf()[node], end = tree.leaf_end()[node];
    std::vector<NodeId> neighbours, places; // with and without folds
    std::size_t count = 0;
    const auto keep_once = [](auto& values) {
        std::ranges::sort(values);
        values.erase(std::unique(values.begin(), values.end()), values.end()); // clang 14 rejects a subrange
    };
    for (const NodeId shown : ring.shown)
        if (shown != node) neighbours.push_back(shown);
    keep_once(neighbours);
    const std::size_t most =
        std::min<std::size_t>(measurement::most_around, measurement::around_a_leaf * (end - begin));
    const auto for_each_place = [&](NodeId neighbour, auto&& use) {
        if (tree.is_place(neighbour)) return use(neighbour);
        for (Index leaf = tree.first_leaf()[neighbour]; leaf < tree.leaf_end()[neighbour];) {
            const NodeId place = tree.place_of_leaf(leaf);
            use(place);
            leaf += tree.wedge_end(place) - tree.first_wedge(place);
            if (count > most) return;
        }
    };
    for (const NodeId neighbour : neighbours) {
        for_each_place(neighbour, [&](NodeId place) { count += triangles_at(place).size(); });
        if (count > most) return;
    }
    for (const Index t : crossing)
        for (const Index leaf : triangles[t])
            if (leaf - begin >= end - begin) places.push_back(tree.place_of_leaf(leaf));
    keep_once(places);
    const auto add = [&](std::vector<Index>& found, const auto& node_of, std::vector<RingTriangle<channels>>& to) {
        keep_once(found);
        for (const Index t : found) {
            RingTriangle<channels> triangle;
            std::array<NodeId, 3> nodes;
            bool is_of_ring = false;
            for (std::size_t k = 0; k < 3; ++k) {
                const Index leaf = triangles[t][k];
                is_of_ring |= leaf - begin < end - begin;
                if (is_of_ring) break;
                nodes[k] = node_of(leaf);
                triangle.corner[k] = points[tree.wedge_at(nodes[k], leaf)];
            }
            triangle.sheet = measurement::no_sheet;
            if (!is_of_ring && are_distinct(nodes)) to.push_back(triangle);
        }
    };
    std::vector<Index> found;
    const auto find_at = [&](NodeId place) {
        const std::span<const Index> at = triangles_at(place);
        found.insert(found.end(), at.begin(), at.end());
    };
    for (const NodeId neighbour : neighbours) for_each_place(neighbour, find_at);
    add(found, stand_in, ring.around);
    found.clear();
    for (const NodeId place : places) find_at(place);
    add(
        found, [&](Index leaf) { return tree.place_of_leaf(leaf); }, ring.fine_around);
}

// The mean distance of the ring's other corners from the proxy.
template <std::size_t channels>
float mean_reach(std::span<const RingTriangle<channels>> ring, const LitPointOf<channels>& proxy) {
    float sum = 0;
    int count = 0;
    for (const RingTriangle<channels>& t : ring) {
        for (std::size_t k = 0; k < 3; ++k) {
            if ((t.inside >> k) & 1) continue;
            sum += glm::length(t.corner[k].position - proxy.position);
            ++count;
        }
    }
    return count > 0 ? sum / static_cast<float>(count) : 0;
}

} // namespace unseen::perception
