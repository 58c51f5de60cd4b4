// What a picture shows of a mesh, triangle by triangle and edge by edge.
#include <unseen/vdtree/depth_picture.h>

#include <algorithm>
#include <array>
#include <cmath>

#include <tbb/parallel_sort.h>

#include <unseen/vdtree/internal/footprint.h>
#include <unseen/vdtree/internal/node_bits.h>
#include <unseen/vdtree/internal/parallel.h>

namespace unseen::vdtree {
namespace {

// Pixels: what is drawn lies within one of the mesh, on either side.
constexpr double apart_px = 2;
// Points of a triangle that are looked for: corners, middles of edges, and four inside.
constexpr std::array<std::array<double, 2>, 10> points = {{{0, 0},
                                                           {1, 0},
                                                           {0, 1},
                                                           {0.5, 0},
                                                           {0, 0.5},
                                                           {0.5, 0.5},
                                                           {1.0 / 3, 1.0 / 3},
                                                           {1.0 / 6, 1.0 / 6},
                                                           {2.0 / 3, 1.0 / 6},
                                                           {1.0 / 6, 2.0 / 3}}};

// Larger triangles are quartered to look for the points of each part; so large ones as need more are shown.
constexpr double small_px = 4;
constexpr int most_quarterings = 8;

class PartsFinder {
public:
    PartsFinder(const SoundTree& tree, const Similarity& placement, const DepthPicture& picture, bool only_front)
        : tree_(tree), picture_(picture), only_front_(only_front),
          inward_(tree.closedness() == Closedness::closed_inward), placement_(placement), project_(picture.view()),
          apart_(apart_px /
                 (picture.view().height / (2 * std::tan(picture.view().fov_y_degrees * std::numbers::pi / 360)))),
          corners_(tree.leaf_count()), signed_areas_(tree.triangle_count()) {
        parallel_loop(Index{0}, tree.leaf_count(), [&](Index leaf) {
            const glm::vec3& at = tree.positions()[tree.wedge_of_leaf(leaf)];
            corners_[leaf] = project_(placement.to_world(tree.origin() + glm::dvec3(at)));
        });
    }

    // Notes which side of each triangle is seen, for what follows.
    ShownParts find_areas() {
        const NodeId nodes = tree_.interior_count();
        ShownParts shown{std::vector<float>(nodes), std::vector<float>(nodes)};
        std::vector<float> areas(tree_.triangle_count());
        parallel_loop(Index{0}, tree_.triangle_count(), [&](Index t) { areas[t] = look_at(t); });
        for (Index t = 0; t < tree_.triangle_count(); ++t)
            for (const Index corner : tree_.triangles()[t]) shown.area[node_over(corner)] += areas[t] / 3;
        add_outlines(shown.outline);
        for (NodeId node = nodes; node-- > 1;) {
            const NodeId above = tree_.parents()[node];
            shown.area[above] += shown.area[node], shown.outline[above] += shown.outline[node];
        }
        return shown;
    }

    // One bit a node.
    std::vector<std::uint64_t> find_hidden() const {
        const NodeId nodes = tree_.interior_count();
        std::vector<std::uint8_t> seen(tree_.triangle_count());
        parallel_loop(Index{0}, tree_.triangle_count(), [&](Index t) { seen[t] = !is_hidden(tree_.triangles()[t]); });
        std::vector<std::uint8_t> is_seen(nodes); // whether any triangle that touches the node is
        for (Index t = 0; t < tree_.triangle_count(); ++t)
            for (const Index corner : tree_.triangles()[t]) is_seen[node_over(corner)] |= seen[t];
        for (NodeId node = nodes; node-- > 1;) is_seen[tree_.parents()[node]] |= is_seen[node];
        unfold_what_pokes_out(is_seen);
        std::vector<std::uint64_t> hidden(words_for(nodes));
        for (NodeId node = 0; node < nodes; ++node)
            if (!is_seen[node]) set_bit(hidden, node);
        return hidden;
    }

private:
    NodeId node_over(Index leaf) const { return tree_.parents()[tree_.place_of_leaf(leaf)]; }
    bool is_hidden(Footprint part) const {
        part.nearest *= 1 - apart_;
        return picture_.hides(part);
    }
    static Footprint between(const Footprint& a, const Footprint& b, const Footprint& c, double u, double v) {
        const double w = 1 - u - v;
        Footprint point;
        point.left = point.right = w * a.left + u * b.left + v * c.left;
        point.top = point.bottom = w * a.top + u * b.top + v * c.top;
        point.nearest = 1 / (w / a.nearest + u / b.nearest + v / c.nearest);
        return point;
    }

    // By points that lie nearer to each other than the pixels around each that are looked at.
    bool is_hidden(const Footprint& a, const Footprint& b, const Footprint& c,
                   int quarterings = most_quarterings) const {
        Footprint all = a;
        all.add(b), all.add(c);
        if (!(all.nearest > 0)) return false; // it reaches behind the eye
        if (is_hidden(all)) return true;
        const double side = std::max(all.right - all.left, all.bottom - all.top);
        if (side <= small_px)
            return std::ranges::all_of(points,
                                       [&](const auto& at) { return is_hidden(between(a, b, c, at[0], at[1])); });
        if (quarterings == 0) return false;
        const Footprint ab = between(a, b, c, 0.5, 0), bc = between(a, b, c, 0.5, 0.5), ca = between(a, b, c, 0, 0.5);
        return is_hidden(ab, bc, ca, quarterings - 1) && is_hidden(a, ab, ca, quarterings - 1) &&
               is_hidden(ab, b, bc, quarterings - 1) && is_hidden(ca, bc, c, quarterings - 1);
    }
    bool is_hidden(const Triangle& t) const { return is_hidden(corners_[t[0]], corners_[t[1]], corners_[t[2]]); }

    // Folds all that is not seen, and unfolds what then is, with what is above, until nothing is any more.
    void unfold_what_pokes_out(std::vector<std::uint8_t>& is_seen) const {
        const NodeId nodes = tree_.interior_count();
        std::vector<Footprint> proxies(nodes);
        parallel_loop(NodeId{0}, nodes, [&](NodeId node) {
            if (is_seen[node]) return;
            proxies[node] = project_(placement_.to_world(tree_.origin() + glm::dvec3(tree_.position(node))));
        });
        std::vector<NodeId> active(tree_.node_count()); // by node: the highest above that is not seen, or itself
        const auto active_at = [&](Index corner) { return active[tree_.place_of_leaf(corner)]; };
        const auto pokes_out = [&](const Triangle& t) {
            const NodeId at[] = {active_at(t[0]), active_at(t[1]), active_at(t[2])};
            if (at[0] == at[1] || at[1] == at[2] || at[2] == at[0]) return false;
            const auto corner = [&](std::size_t k) { return at[k] < nodes ? proxies[at[k]] : corners_[t[k]]; };
            return !is_hidden(corner(0), corner(1), corner(2));
        };
        std::vector<std::uint8_t> has_changed(tree_.triangle_count(), 1), pokes(tree_.triangle_count());
        for (bool is_done = false; !is_done;) {
            for (NodeId node = 0; node < tree_.node_count(); ++node) {
                const NodeId above = node > 0 ? tree_.parents()[node] : node;
                active[node] = node == above || is_seen[above] ? node : active[above];
            }
            parallel_loop(Index{0}, tree_.triangle_count(), [&](Index t) {
                const Triangle& triangle = tree_.triangles()[t];
                const bool is_folded = std::ranges::any_of(triangle, [&](Index c) { return active_at(c) < nodes; });
                pokes[t] = has_changed[t] && is_folded && pokes_out(triangle);
            });
            is_done = true;
            for (Index t = 0; t < tree_.triangle_count(); ++t)
                for (const Index corner : tree_.triangles()[t])
                    if (pokes[t] && active_at(corner) < nodes) is_seen[active_at(corner)] = 1, is_done = false;
            for (Index t = 0; t < tree_.triangle_count(); ++t)
                has_changed[t] = std::ranges::any_of(tree_.triangles()[t], [&](Index corner) {
                    return active_at(corner) < nodes && is_seen[active_at(corner)];
                });
        }
    }

    // Square pixels of the triangle that are shown; notes which side of it is.
    float look_at(Index t) {
        const Triangle& triangle = tree_.triangles()[t];
        const Footprint &a = corners_[triangle[0]], &b = corners_[triangle[1]], &c = corners_[triangle[2]];
        if (!(std::min({a.nearest, b.nearest, c.nearest}) > 0)) return huge; // it reaches behind the eye
        const double twice = (b.top - a.top) * (c.left - a.left) - (b.left - a.left) * (c.top - a.top); // y is down
        signed_areas_[t] = static_cast<float>(inward_ ? -twice / 2 : twice / 2);
        if (only_front_ && signed_areas_[t] <= 0) return 0;
        Footprint all = a;
        all.add(b), all.add(c);
        if (is_hidden(all)) return 0;
        double shown = 0;
        for (const auto& [u, v] : points) shown += is_hidden(between(a, b, c, u, v)) ? 0 : 1.0 / points.size();
        return static_cast<float>(shown * std::abs(twice) / 2);
    }

    void add_outlines(std::vector<float>& outline) const {
        struct Side {
            std::uint64_t edge; // its two places
            Index triangle, leaf, next;
        };
        std::vector<Side> sides;
        sides.reserve(3 * std::size_t{tree_.triangle_count()});
        for (Index t = 0; t < tree_.triangle_count(); ++t)
            for (std::size_t k = 0; k < 3; ++k) {
                const Index leaf = tree_.triangles()[t][k], next = tree_.triangles()[t][(k + 1) % 3];
                const NodeId a = tree_.place_of_leaf(leaf), b = tree_.place_of_leaf(next);
                sides.push_back({std::uint64_t{std::min(a, b)} << 32 | std::max(a, b), t, leaf, next});
            }
        tbb::parallel_sort(sides, [](const Side& a, const Side& b) {
            return a.edge != b.edge ? a.edge < b.edge : a.triangle < b.triangle;
        });
        for (std::size_t first = 0, end = 0; first < sides.size(); first = end) {
            const auto faces_eye = [&](const Side& side) { return signed_areas_[side.triangle] > 0; };
            bool is_outline = false;
            for (end = first; end < sides.size() && sides[end].edge == sides[first].edge; ++end)
                is_outline |= faces_eye(sides[end]) != faces_eye(sides[first]);
            if (!is_outline && end - first > 1) continue;
            const Footprint &a = corners_[sides[first].leaf], &b = corners_[sides[first].next];
            if (!(std::min(a.nearest, b.nearest) > 0) || is_hidden(between(a, b, a, 0.5, 0))) continue;
            const auto half = static_cast<float>(std::hypot(a.left - b.left, a.top - b.top) / 2);
            outline[node_over(sides[first].leaf)] += half;
            outline[node_over(sides[first].next)] += half;
        }
    }

    static constexpr float huge = 1e18f;
    const SoundTree& tree_;
    const DepthPicture& picture_;
    bool only_front_, inward_;
    const Similarity& placement_;
    Projector project_;
    double apart_;                    // as a share of the distance
    std::vector<Footprint> corners_;  // by leaf
    std::vector<float> signed_areas_; // by triangle: above 0 where it faces the eye
};

} // namespace

void ShownParts::add(const ShownParts& other, float areas, float outlines) {
    std::ranges::transform(area, other.area, area.begin(), [&](float a, float b) { return a + areas * b; });
    std::ranges::transform(outline, other.outline, outline.begin(), [&](float a, float b) { return a + outlines * b; });
}

Result<ShownParts> find_shown(const VertexTree& tree, const Similarity& placement, const DepthPicture& picture,
                              bool only_front) {
    const auto sound = SoundTree::of(tree);
    if (!sound) return sound.error();
    return PartsFinder(*sound, placement, picture, only_front).find_areas();
}

Result<std::vector<std::uint64_t>> find_hidden(const VertexTree& tree, const Similarity& placement,
                                               const DepthPicture& picture) {
    const auto sound = SoundTree::of(tree);
    if (!sound) return sound.error();
    return PartsFinder(*sound, placement, picture, false).find_hidden();
}

} // namespace unseen::vdtree
