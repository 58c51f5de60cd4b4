#include "build/bound_displacements.h"

#include <limits>
#include <optional>

#include <glm/geometric.hpp>

#include "build/bounding_sphere.h"
#include <unseen/vdtree/internal/triangle_plane.h>
#include <unseen/vdtree/internal/vectors.h>

namespace unseen::vdtree {

namespace {

// Nodes with more places than this are bounded through their children: looking for the farthest plane of very many again
// in each of their ancestors would cost the square of their number where trees are deep.
constexpr Index most_measured_places = 4096;
// So many places are looked at one by one sooner than their nodes.
constexpr Index few_places = 12;
// Share of the support sphere's radius. Where no plane can be farther away than this, none is looked at: a model as high
// as a window of 1000 pixels folds to within a tenth of a pixel.
constexpr double negligible_share = 1e-4;
// Share of a length: covers the rounding of cones to floats.
constexpr float cone_rounding = 1e-6f;
// Cones that open wider than this, 87 degrees to either side, count as everything.
constexpr float least_cosine = 0.05f;

// By place: the unit normals of the triangles around it, and of planes that stand on irregular edges there. Zero for
// triangles that are too thin to have one.
struct PlaneNormals {
    std::vector<Index> start; // one longer
    ParallelArray<glm::vec3> normals;
    std::vector<std::uint8_t> is_held; // by place: it is free to move in no direction

    std::span<const glm::vec3> around(Index place) const {
        return std::span<const glm::vec3>(normals).subspan(start[place], start[place + 1] - start[place]);
    }
};

class PlaneFinder {
public:
    PlaneFinder(const BoundInput& input, std::span<const Triangle> triangles, std::span<const std::uint8_t> irregular)
        : in_(input), triangles_(triangles), irregular_(irregular) {}

    PlaneNormals run() const {
        PlaneNormals out;
        out.start.assign(in_.shape.leaves() + 1, 0);
        for_each_side([&](const TreePart& part, const Triangle& corners, std::size_t k, bool stands, const auto&) {
            const Index from = corners[k], to = corners[(k + 1) % 3];
            if (in_.parts.owns_leaf(part, from)) out.start[from] += stands ? 2 : 1;
            if (stands && in_.parts.owns_leaf(part, to)) ++out.start[to];
        });
        std::partial_sum(out.start.begin(), out.start.end(), out.start.begin());
        out.normals = ParallelArray<glm::vec3>(out.start.back(), Unfilled());
        out.is_held.resize(in_.shape.leaves());
        parallel_loop_over(tbb::blocked_range<Index>(0, in_.shape.leaves()), [&](const auto& places) {
            Tip tip;
            for (Index place = places.begin(); place < places.end(); ++place)
                out.is_held[place] = irregular_[place] && is_tip(place, tip);
        });
        // From the end of each place's range, which is its start when all are in.
        for_each_side([&](const TreePart& part, const Triangle& corners, std::size_t k, bool stands, auto&& normal) {
            const Index from = corners[k], to = corners[(k + 1) % 3];
            const auto add = [&](Index place, glm::dvec3 n) {
                if (in_.parts.owns_leaf(part, place)) out.normals[--out.start[place]] = glm::vec3(n);
            };
            add(from, normal());
            if (!stands) return;
            const glm::dvec3 outward = unit(glm::cross(in_.leaf_position(to) - in_.leaf_position(from), normal()));
            for (const Index end : {from, to}) {
                add(end, outward);
                if (normal() == glm::dvec3(0) && in_.parts.owns_leaf(part, end)) out.is_held[end] = true;
            }
        });
        return out;
    }

private:
    // Calls use(part, corners, k, whether a plane stands on the side from corner k, a function for the normal).
    template <class F>
    void for_each_side(F&& use) const {
        in_.parts.for_each_triangle([&](const TreePart& part) {
            return [&](Index t) {
                const Triangle& corners = triangles_[t];
                std::optional<glm::dvec3> known;
                const auto normal = [&] {
                    if (!known)
                        known = plane_normal(in_.leaf_position(corners[0]), in_.leaf_position(corners[1]),
                                             in_.leaf_position(corners[2]));
                    return *known;
                };
                for (std::size_t k = 0; k < 3; ++k)
                    use(part, corners, k, is_irregular(corners[k], corners[(k + 1) % 3]), normal);
            };
        });
    }

    struct Tip {
        std::vector<Index> preceding, following, ends;
        std::vector<glm::dvec3> ways;
    };
    // Whether an irregular edge ends at the place and none goes on about as it does: planes that stand on the two edges of
    // a sharp tip hardly hold it along its middle.
    bool is_tip(Index place, Tip& tip) const {
        constexpr double most_cosine = -0.5;      // of the angle between edges that go on, 120 degrees or more
        constexpr std::size_t most_compared = 64; // irregular edges of one place
        const auto ring = in_.rings.around(place);
        std::vector<Index>&preceding = tip.preceding, &following = tip.following, &ends = tip.ends;
        std::vector<glm::dvec3>& ways = tip.ways;
        preceding.clear(), following.clear(), ends.clear(), ways.clear();
        for (std::size_t i = 0; i < ring.size(); i += 2) preceding.push_back(ring[i]), following.push_back(ring[i + 1]);
        std::ranges::sort(preceding);
        std::ranges::sort(following);
        // That do not follow once and precede once.
        std::ranges::set_symmetric_difference(preceding, following, std::back_inserter(ends));
        for (std::size_t i = 1; i < following.size(); ++i)
            if (following[i] == following[i - 1]) ends.push_back(following[i]);
        if (ends.size() > most_compared) return true;
        for (const Index end : ends) ways.push_back(unit(in_.leaf_position(end) - in_.leaf_position(place)));
        return std::ranges::any_of(ways, [&](const glm::dvec3& way) {
            return std::ranges::none_of(ways,
                                        [&](const glm::dvec3& other) { return glm::dot(way, other) <= most_cosine; });
        });
    }

    // Whether the edge has other triangles than two that run it in opposite ways.
    bool is_irregular(Index a, Index b) const {
        if (!irregular_[a] || !irregular_[b]) return false;
        const auto of_a = in_.rings.around(a), of_b = in_.rings.around(b);
        const auto& ring = of_a.size() <= of_b.size() ? of_a : of_b;
        const Index other = of_a.size() <= of_b.size() ? b : a;
        int preceding = 0, following = 0; // irregular places have both of each triangle
        for (std::size_t i = 0; i < ring.size(); i += 2) {
            preceding += ring[i] == other;
            following += ring[i + 1] == other;
        }
        return preceding != 1 || following != 1;
    }

    const BoundInput& in_;
    std::span<const Triangle> triangles_;
    std::span<const std::uint8_t> irregular_;
};

// Directions within an angle of an axis.
struct NormalCone {
    glm::vec3 axis{0};
    float sine = 0, cosine = 1; // of the angle
    bool is_held = false;       // one of the places is

    static NormalCone everything() {
        NormalCone all;
        all.sine = 1, all.cosine = 0;
        return all;
    }
    bool is_empty() const { return axis == glm::vec3(0) && cosine > 0; }
    bool is_everything() const { return !(cosine > 0); }

    // The largest |n . v| of its directions.
    double reach(glm::dvec3 v) const {
        const double length2 = glm::dot(v, v), length = std::sqrt(length2);
        const double along = std::abs(glm::dot(glm::dvec3(axis), v));
        const double across = std::sqrt(std::max(0.0, length2 - along * along));
        const double c = static_cast<double>(cosine), s = static_cast<double>(sine);
        const double most = is_held || across * c <= along * s ? length : along * c + across * s;
        return std::min(length, most + static_cast<double>(cone_rounding) * length);
    }
};

// The smallest cone around both, but for rounding outward.
NormalCone united(const NormalCone& a, const NormalCone& b) {
    if (a.is_empty() || b.is_everything()) return b;
    if (b.is_empty() || a.is_everything()) return a;
    const glm::dvec3 from(a.axis), to(b.axis);
    const double sin_a = a.sine, cos_a = a.cosine, sin_b = b.sine, cos_b = b.cosine;
    const double cos_between = glm::dot(from, to), sin_between = glm::length(glm::cross(from, to));
    // Angles from one axis to the other cone's far side.
    const double sin_ab = sin_between * cos_b + cos_between * sin_b, cos_ab = cos_between * cos_b - sin_between * sin_b;
    const double sin_ba = sin_between * cos_a + cos_between * sin_a, cos_ba = cos_between * cos_a - sin_between * sin_a;
    if (sin_ab < 0 || sin_ba < 0) return NormalCone::everything(); // more than half a turn
    if (sin_a * cos_ab - cos_a * sin_ab >= 0) return a;
    if (sin_b * cos_ba - cos_b * sin_ba >= 0) return b;
    const double sin_all = sin_ab * cos_a + cos_ab * sin_a, cos_all = cos_ab * cos_a - sin_ab * sin_a;
    const double cosine = std::sqrt(std::max(0.0, (1 + cos_all) / 2));
    if (sin_all < 0 || cosine < static_cast<double>(least_cosine) || !(sin_between > 0))
        return NormalCone::everything();
    const double sine = sin_all / (2 * cosine);
    const double sin_turn = sine * cos_a - cosine * sin_a, cos_turn = cosine * cos_a + sine * sin_a;
    const glm::dvec3 across = (to - cos_between * from) / sin_between;
    return {.axis = glm::vec3(glm::normalize(cos_turn * from + sin_turn * across)),
            .sine = std::min(1.0f, static_cast<float>(sine) + cone_rounding),
            .cosine = static_cast<float>(cosine)};
}

void include(NormalCone& cone, const NormalCone& other, bool is_held) {
    is_held |= cone.is_held;
    cone = united(cone, other);
    cone.is_held = is_held;
}

NormalCone around(std::span<const glm::vec3> normals) {
    glm::dvec3 sum(0);
    bool any = false;
    for (const glm::vec3& normal : normals) {
        sum += glm::dvec3(normal);
        any |= normal != glm::vec3(0);
    }
    if (!any) return {};
    const glm::vec3 axis(unit(sum));
    if (axis == glm::vec3(0)) return NormalCone::everything();
    float cosine = 1, sine2 = 0; // of the largest angle
    for (const glm::vec3& normal : normals) {
        if (normal == glm::vec3(0)) continue;
        const glm::vec3 across = glm::cross(normal, axis);
        cosine = std::min(cosine, glm::dot(normal, axis));
        sine2 = std::max(sine2, glm::dot(across, across));
    }
    if (cosine < least_cosine) return NormalCone::everything();
    return {.axis = axis, .sine = std::min(1.0f, std::sqrt(sine2) + cone_rounding), .cosine = cosine};
}

// What is known of the nodes below.
struct Displacements {
    std::vector<float> moved;      // the result
    std::vector<float> off_planes; // no plane is farther from the proxy
    std::vector<NormalCone> cones; // of the planes
};

class DisplacementWorker {
public:
    DisplacementWorker(const BoundInput& input, const PlaneNormals& planes, std::span<const Sphere> support,
                       Displacements& out)
        : in_(input), planes_(planes), support_(support), out_(out) {}

    void operator()(NodeId node) {
        const TreeShape& shape = in_.shape;
        proxy_ = in_.position(node);
        NormalCone cone;
        double moved = 0, bounded = 0, of_places = 0;
        shape.for_each_child(
            node,
            [&](NodeId child) {
                moved = std::max(moved, static_cast<double>(out_.moved[child]));
                bounded = std::max(bounded, bound(child));
                include(cone, out_.cones[child], out_.cones[child].is_held);
            },
            [&](Index place) {
                include(cone, around(planes_.around(place)), planes_.is_held[place]);
                of_places = std::max(of_places, off_planes(place));
            });
        bounded = std::max(bounded, of_places);
        const double radius = static_cast<double>(support_[node].radius), whole = farthest_place(node);
        negligible_ = negligible_share * radius;
        if (!cone.is_everything() && bounded > negligible_ &&
            shape.leaf_end[node] - shape.first_leaf[node] <= most_measured_places) {
            farthest_ = of_places, accepted_ = 0;
            enough_ = whole * static_cast<double>(cone.cosine);
            measure(node, true);
            if (farthest_ < enough_) bounded = std::max(farthest_, accepted_);
        }
        bounded = std::min(whole, bounded + displacement_rounding * radius);
        const bool has_side = !cone.is_empty() && !cone.is_everything();
        const double seen = bounded / static_cast<double>(cone.cosine);
        moved = std::max(moved, has_side && seen < whole ? seen : std::min(whole, farthest_of_few(node)));
        out_.off_planes[node] = round_up(bounded);
        out_.moved[node] = round_up(moved);
        out_.cones[node] = cone;
    }

private:
    double off_planes(Index place) const {
        const glm::dvec3 way = proxy_ - in_.leaf_position(place);
        if (planes_.is_held[place]) return glm::length(way);
        double farthest = 0;
        for (const glm::vec3& normal : planes_.around(place))
            farthest = std::max(farthest, std::abs(glm::dot(glm::dvec3(normal), way)));
        return farthest;
    }

    // The farthest place from the proxy, where there are few.
    double farthest_of_few(NodeId node) const {
        const Index begin = in_.shape.first_leaf[node], end = in_.shape.leaf_end[node];
        if (end - begin > few_places) return std::numeric_limits<double>::infinity();
        double farthest = 0;
        for (Index place = begin; place < end; ++place)
            farthest = std::max(farthest, glm::distance(proxy_, in_.leaf_position(place)));
        return farthest + displacement_rounding * static_cast<double>(support_[node].radius);
    }
    // No place under the node is farther from the proxy.
    double farthest_place(NodeId node) const {
        return glm::distance(proxy_, glm::dvec3(support_[node].centre)) + static_cast<double>(support_[node].radius);
    }
    // No plane of the node's is farther from the proxy.
    double bound(NodeId node) const {
        return std::min(static_cast<double>(out_.off_planes[node]) +
                            out_.cones[node].reach(proxy_ - in_.position(node)),
                        farthest_place(node));
    }

    // Looks where a farther plane may be, likely places first, until it is far enough. `is_known`: the node's own places
    // have been looked at.
    void measure(NodeId node, bool is_known = false) {
        const TreeShape& shape = in_.shape;
        if (farthest_ >= enough_) return;
        const auto measure_places = [&](Index begin, Index end) {
            for (Index place = begin; place < end; ++place) farthest_ = std::max(farthest_, off_planes(place));
        };
        const auto measure_place = [&](Index place) {
            if (!is_known) measure_places(place, place + 1);
        };
        if (shape.leaf_end[node] - shape.first_leaf[node] <= few_places) {
            const auto measure_child = [&](NodeId child) {
                measure_places(shape.first_leaf[child], shape.leaf_end[child]);
            };
            return shape.for_each_child(node, measure_child, measure_place);
        }
        NodeId likely = no_node;
        double most = farthest_;
        shape.for_each_child(
            node,
            [&](NodeId child) {
                const double most_here = bound(child);
                if (most_here <= negligible_) accepted_ = std::max(accepted_, most_here);
                else if (most_here > most) most = most_here, likely = child;
            },
            measure_place);
        if (likely == no_node) return;
        measure(likely);
        shape.for_each_child(
            node,
            [&](NodeId child) {
                if (child != likely && bound(child) > std::max(farthest_, negligible_)) measure(child);
            },
            [](Index) {});
    }

    const BoundInput& in_;
    const PlaneNormals& planes_;
    std::span<const Sphere> support_;
    Displacements& out_;
    glm::dvec3 proxy_;
    double negligible_, enough_;
    double farthest_, accepted_; // of the planes that were measured; of those that were not
};

} // namespace

std::vector<float> bound_displacements(const BoundInput& input, std::span<const Triangle> triangles,
                                       std::span<const std::uint8_t> irregular, std::span<const Sphere> support) {
    const std::size_t nodes = input.shape.interior();
    const PlaneNormals planes = PlaneFinder(input, triangles, irregular).run();
    Displacements out{std::vector<float>(nodes), std::vector<float>(nodes), std::vector<NormalCone>(nodes)};
    input.parts.bottom_up([&] { return DisplacementWorker(input, planes, support, out); });
    return std::move(out.moved);
}

} // namespace unseen::vdtree
