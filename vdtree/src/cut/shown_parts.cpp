// What a picture shows of a mesh, triangle by triangle and edge by edge.
#include <unseen/vdtree/depth_picture.h>

#include <algorithm>
#include <array>
#include <cmath>

#include <tbb/parallel_sort.h>

#include <unseen/vdtree/internal/footprint.h>
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

class PartsFinder {
public:
    PartsFinder(const SoundTree& tree, const Similarity& placement, const DepthPicture& picture, bool only_front)
        : tree_(tree), picture_(picture), only_front_(only_front),
          inward_(tree.closedness() == Closedness::closed_inward),
          apart_(apart_px /
                 (picture.view().height / (2 * std::tan(picture.view().fov_y_degrees * std::numbers::pi / 360)))),
          corners_(tree.leaf_count()), signed_areas_(tree.triangle_count()) {
        const Projector project(picture.view());
        parallel_loop(Index{0}, tree.leaf_count(), [&](Index leaf) {
            const glm::vec3& at = tree.positions()[tree.wedge_of_leaf(leaf)];
            corners_[leaf] = project(placement.to_world(tree.origin() + glm::dvec3(at)));
        });
    }

    ShownParts find() {
        std::vector<float> areas(tree_.triangle_count());
        parallel_loop(Index{0}, tree_.triangle_count(), [&](Index t) { areas[t] = look_at(t); });
        ShownParts shown{std::vector<float>(tree_.interior_count()), std::vector<float>(tree_.interior_count())};
        for (Index t = 0; t < tree_.triangle_count(); ++t)
            for (const Index corner : tree_.triangles()[t]) shown.area[node_over(corner)] += areas[t] / 3;
        add_outlines(shown.outline);
        for (auto* sums : {&shown.area, &shown.outline})
            for (NodeId node = tree_.interior_count(); node-- > 1;) (*sums)[tree_.parents()[node]] += (*sums)[node];
        return shown;
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

    // Square pixels of the triangle that are shown; notes which side of it is.
    float look_at(Index t) {
        const Triangle& triangle = tree_.triangles()[t];
        const Footprint &a = corners_[triangle[0]], &b = corners_[triangle[1]], &c = corners_[triangle[2]];
        Footprint all = a;
        all.add(b), all.add(c);
        if (!(all.nearest > 0)) return huge; // it reaches behind the eye
        const double twice = (b.top - a.top) * (c.left - a.left) - (b.left - a.left) * (c.top - a.top); // y is down
        signed_areas_[t] = static_cast<float>(inward_ ? -twice / 2 : twice / 2);
        if (only_front_ && signed_areas_[t] <= 0) return 0;
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
    double apart_;                    // as a share of the distance
    std::vector<Footprint> corners_;  // by leaf
    std::vector<float> signed_areas_; // by triangle: above 0 where it faces the eye
};

} // namespace

Result<ShownParts> find_shown(const VertexTree& tree, const Similarity& placement, const DepthPicture& picture,
                              bool only_front) {
    const auto sound = SoundTree::of(tree);
    if (!sound) return sound.error();
    return PartsFinder(*sound, placement, picture, only_front).find();
}

} // namespace unseen::vdtree
