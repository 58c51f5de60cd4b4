#include "fold_tester.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <glm/geometric.hpp>

namespace unseen::vdtree {

namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

// Slacks are shortened by these, so that rounding in a later test cannot change a verdict before its time. Shares of the
// distance to the eye: a dozen roundings of a float; the facing gap sums a few dozen products.
constexpr float position_rounding = 2e-6f;
constexpr float facing_rounding = 2e-5f;
// Radians: angles come from cosines in floats, which near 1 tell angles apart to about half of this.
constexpr float angle_rounding = 1e-3f;
// With a gaze, a node is tested again after this share of its gap at the latest; see path_of().
constexpr float longest_path = 0.125f;
constexpr float shift_per_gap = 1.16f; // asin(x) / x / (1 - longest_path) for x up to longest_path / (1 - longest_path)

} // namespace

// One node: what was measured, and what the criterion says of it here.
struct FoldTester::Lane {
    NodeId node;
    FoldClass row;
    float length, distance, radius, gap, eccentricity, height;
    float interior, silhouette; // the distances within which it unfolds
};

FoldTester::FoldTester(const VertexTree& tree, const DistanceCriterion& criterion, bool cull_back_faces, float threshold)
    : tree_(tree), criterion_(criterion), cull_back_faces_(cull_back_faces), has_silhouettes_(criterion.uses_silhouettes()),
      threshold_(threshold), bins_(criterion.parts().eccentricity_bins) {
    const auto& reach = criterion.parts().reach;
    const auto& least_cost = criterion.parts().least_cost;
    reach_.resize(reach.size());
    for (std::size_t i = 0; i < reach.size(); ++i) {
        const bool always = reach[i] >= DistanceCriterion::always_visible || (!least_cost.empty() && least_cost[i] > threshold);
        const bool never = reach[i] <= DistanceCriterion::never_visible;
        reach_[i] = never ? -infinity : always ? infinity : reach[i] / threshold;
    }
}

void FoldTester::look_from(const Viewpoint& viewpoint, double length_per_radian) {
    view_ = {};
    for (int k = 0; k < 3; ++k) {
        view_.eye_high[k] = static_cast<float>(viewpoint.eye[k]);
        view_.eye_low[k] = static_cast<float>(viewpoint.eye[k] - static_cast<double>(view_.eye_high[k]));
    }
    view_.has_gaze = viewpoint.gaze.has_value() && criterion_.uses_gaze();
    if (view_.has_gaze)
        for (int k = 0; k < 3; ++k) view_.gaze[k] = static_cast<float>((*viewpoint.gaze)[k]);
    for (const Frustum& frustum : viewpoint.frusta) {
        view_.first_plane.push_back(view_.planes.size());
        for (const Plane& plane : frustum.planes) {
            const glm::vec3 n(plane.normal);
            view_.planes.push_back({{n.x, n.y, n.z}, static_cast<float>(glm::dot(plane.normal, viewpoint.eye) + plane.offset)});
        }
    }
    view_.first_plane.push_back(view_.planes.size());
    inverse_bin_ = static_cast<float>(180 / (std::numbers::pi * criterion_.parts().bin_degrees));
    turn_per_length_ = static_cast<float>(1 / length_per_radian);
    last_bin_ = static_cast<float>(bins_ - 1);
}

float FoldTester::distance_of(std::uint16_t row, std::size_t bin, float length) const {
    const float reach = reach_[row * bins_ + bin];
    return std::abs(reach) < infinity ? length * reach : reach; // a length of 0 times infinity is no number
}

std::size_t FoldTester::bin_of(float eccentricity) const {
    return static_cast<std::size_t>(std::clamp(eccentricity * inverse_bin_, 0.0f, last_bin_));
}

// The threshold at which the node, classed by `row` and unfolding within `reach`, would just fold.
float FoldTester::cost_of(std::uint16_t row, const Lane& lane, float reach) const {
    if (!(reach > 0)) return 0;
    if (!(lane.gap > 0)) return infinity;
    const DistanceCriterion::Parts& parts = criterion_.parts();
    const std::size_t entry = row * bins_ + (view_.has_gaze ? bin_of(lane.eccentricity) : 0);
    if (parts.reach[entry] >= DistanceCriterion::always_visible) return infinity;
    const float by_distance = lane.length * parts.reach[entry] / lane.gap;
    return parts.least_cost.empty() ? by_distance : std::max(by_distance, parts.least_cost[entry]);
}

// How far the position clock may advance with the sphere's eccentricity changing by less than `turn`: meanwhile the gaze turns by
// path / length_per_radian, and a point at least `gap` away shifts by asin(step / rest) for each step, the rest of the gap being
// what longest_path leaves: less than shift_per_gap * path / gap in all.
float FoldTester::path_of(float turn, float gap) const {
    return std::min((turn - angle_rounding) / (turn_per_length_ + shift_per_gap / gap), longest_path * gap);
}

// How far the clock may advance with the node still beyond the distance of its class, `reach` here. Reaches grow towards the
// gaze: the farther the bins that are looked at, the more turn they allow and the less path.
float FoldTester::folded_slack(std::uint16_t row, const Lane& lane, float reach) const {
    const float here = lane.gap - reach;
    if (!view_.has_gaze) return here;
    const std::size_t bin = bin_of(lane.eccentricity);
    float best = 0, there = here;
    for (std::size_t step = 0;; step = step == 0 ? 1 : 2 * step) {
        const std::size_t nearest = bin - std::min(bin, step);
        there = step == 0 ? here : lane.gap - distance_of(row, nearest, lane.length);
        const float turn = nearest == 0 ? infinity : lane.eccentricity - static_cast<float>(nearest) / inverse_bin_;
        best = std::max(best, std::min(there, path_of(turn, lane.gap)));
        if (there <= best || nearest == 0) return best;
    }
}

// How far the clock may advance with the node still within it.
float FoldTester::unfolded_slack(std::uint16_t row, const Lane& lane, float reach) const {
    const float here = reach - lane.gap;
    if (!view_.has_gaze) return here;
    // Inside, or nearly, the eccentricity may be anything soon.
    if (!(lane.gap > 0)) return std::max(0.0f, distance_of(row, bins_ - 1, lane.length) - lane.gap);
    const std::size_t bin = bin_of(lane.eccentricity), last = bins_ - 1;
    float best = 0, there = here;
    for (std::size_t step = 0;; step = step == 0 ? 1 : 2 * step) {
        const std::size_t farthest = std::min(bin + step, last);
        there = step == 0 ? here : distance_of(row, farthest, lane.length) - lane.gap;
        const float turn = farthest == last ? infinity : static_cast<float>(farthest + 1) / inverse_bin_ - lane.eccentricity;
        best = std::max(best, std::min(there, path_of(turn, lane.gap)));
        if (there <= best || farthest == last) return best;
    }
}

void FoldTester::test(std::span<const NodeId> nodes, std::span<Verdict> verdicts) const {
    for (std::size_t first = 0; first < nodes.size(); first += kernel_lanes)
        test_batch(nodes.subspan(first, std::min(kernel_lanes, nodes.size() - first)), verdicts.data() + first);
}

void FoldTester::test_batch(std::span<const NodeId> nodes, Verdict* verdicts) const {
    const NodeBounds* const bounds = tree_.bounds().data();
    const Sphere* const support =
        criterion_.parts().spheres == DistanceCriterion::Spheres::support ? tree_.support_spheres().data() : nullptr;
    SphereBatch spheres;
    for (std::size_t i = 0; i < kernel_lanes; ++i) {
        const NodeId node = nodes[std::min(i, nodes.size() - 1)];
        const Sphere& sphere = support ? support[node] : bounds[node].ring;
        spheres.centre[0][i] = sphere.centre.x;
        spheres.centre[1][i] = sphere.centre.y;
        spheres.centre[2][i] = sphere.centre.z;
        spheres.radius[i] = sphere.radius;
    }
    measure(view_, spheres);

    FacingBatch facing;
    std::size_t asked = 0;
    std::array<std::uint8_t, kernel_lanes> asker;
    std::array<Lane, kernel_lanes> lanes;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        const NodeId node = nodes[i];
        const Lane& lane = lanes[i] = lane_of(node, spheres, i);
        const bool facing_decides = lane.height >= 0 && lane.gap < lane.silhouette &&
                                    (cull_back_faces_ || (has_silhouettes_ && !(lane.gap < lane.interior)));
        if (!facing_decides) {
            verdicts[i] = judge_by_distance(lane);
            continue;
        }
        const Sphere& ring = bounds[node].ring;
        if (support) { // another sphere than the one measured
            const auto towards = [&](int k) { return (view_.eye_high[k] - ring.centre[k]) + view_.eye_low[k]; };
            facing.set(asked, bounds[node].slabs, towards(0), towards(1), towards(2), ring.radius);
        } else {
            facing.set(asked, bounds[node].slabs, spheres.to_eye[0][i], spheres.to_eye[1][i], spheres.to_eye[2][i], ring.radius);
        }
        asker[asked++] = static_cast<std::uint8_t>(i);
    }
    if (asked == 0) return;
    for (std::size_t unused = asked; unused < kernel_lanes; ++unused) facing.set(unused, NormalSlabs{}, 0, 0, 0, 0);
    FacingGaps gaps;
    facing_gaps(facing, gaps);
    for (std::size_t k = 0; k < asked; ++k) {
        const Lane& lane = lanes[asker[k]];
        const NodeBounds& around = bounds[lane.node];
        float front = gaps.front[k], back = gaps.back[k];
        if (around.flags & irregular_ring) front = back = -infinity;       // an outline from everywhere
        else if (around.slabs.empty()) front = infinity, back = -infinity; // no triangle with an area
        verdicts[asker[k]] = judge(lane, front, back);
    }
}

FoldTester::Lane FoldTester::lane_of(NodeId node, const SphereBatch& spheres, std::size_t i) const {
    const DistanceCriterion::Parts& parts = criterion_.parts();
    Lane lane;
    lane.node = node;
    lane.row = parts.classes.empty() ? FoldClass{} : parts.classes[node];
    lane.distance = spheres.distance[i];
    lane.radius = spheres.radius[i];
    lane.length = parts.lengths.empty() ? lane.radius : parts.lengths[node];
    lane.gap = spheres.gap[i];
    lane.eccentricity = spheres.eccentricity[i];
    lane.height = spheres.height[i];
    const std::size_t bin = view_.has_gaze ? bin_of(lane.eccentricity) : 0;
    lane.interior = distance_of(lane.row.interior, bin, lane.length);
    lane.silhouette = has_silhouettes_ ? distance_of(lane.row.silhouette, bin, lane.length) : lane.interior;
    return lane;
}

// Where facing makes no difference.
Verdict FoldTester::judge_by_distance(const Lane& lane) const {
    const float rounding = position_rounding * (lane.distance + lane.radius);
    if (lane.height < 0) return {infinity, std::max(0.0f, -lane.height - rounding), 0, false};
    const bool unfolded = lane.gap < lane.interior;
    const float reach = unfolded ? lane.interior : lane.silhouette;
    const std::uint16_t row = unfolded || !has_silhouettes_ ? lane.row.interior : lane.row.silhouette;
    const float slack = unfolded ? unfolded_slack(row, lane, reach) : folded_slack(row, lane, reach);
    const float height_slack = unfolded ? std::max(0.0f, lane.height - rounding) : infinity;
    return {std::max(0.0f, slack - rounding), height_slack, cost_of(row, lane, reach), unfolded};
}

Verdict FoldTester::judge(const Lane& lane, float front, float back) const {
    const bool faces_away = cull_back_faces_ && back > 0;
    const bool is_silhouette = !(front > 0) && !(back > 0);
    const std::uint16_t row = is_silhouette ? lane.row.silhouette : lane.row.interior;
    const float reach = is_silhouette ? lane.silhouette : lane.interior;
    Verdict verdict;
    verdict.unfolded = !faces_away && lane.gap < reach;
    if (faces_away) {
        verdict.position_slack = infinity;
        verdict.facing_slack = back;
    } else if (verdict.unfolded) {
        // Within the interior's distance nothing but facing away folds it.
        if (lane.gap < lane.interior) {
            verdict.position_slack = unfolded_slack(lane.row.interior, lane, lane.interior);
            verdict.facing_slack = cull_back_faces_ ? -back : infinity;
        } else {
            verdict.position_slack = unfolded_slack(row, lane, reach);
            verdict.facing_slack = std::min(-front, -back);
        }
        verdict.facing_slack = std::min(verdict.facing_slack, lane.height);
    } else {
        verdict.position_slack = folded_slack(row, lane, reach);
        verdict.facing_slack = std::max(front, back);
    }
    verdict.position_slack = std::max(0.0f, verdict.position_slack - position_rounding * (lane.distance + lane.radius));
    verdict.facing_slack = std::max(0.0f, verdict.facing_slack - facing_rounding * lane.distance);
    verdict.cost = faces_away ? 0 : cost_of(row, lane, reach);
    return verdict;
}

Motion FoldTester::motion(const VertexTree& tree, const Viewpoint& from, const Viewpoint& to, double length_per_radian) {
    constexpr Motion jump{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
    if (from.gaze.has_value() != to.gaze.has_value() || from.frusta.size() != to.frusta.size()) return jump;
    const Sphere& root = tree.bounds()[VertexTree::root()].ring; // contains the centres of all spheres
    const glm::dvec3 centre(root.centre);
    const double radius = root.radius;
    const auto angle_between = [](glm::dvec3 a, glm::dvec3 b) {
        return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
    };

    Motion motion;
    motion.facing = glm::length(to.eye - from.eye);
    // Seen as a shift of the eye: everything comes nearer by its path at most, and the gaze turns by its angle.
    motion.position = motion.facing + (from.gaze ? length_per_radian * angle_between(*from.gaze, *to.gaze) : 0);
    // Seen as a turn of the tree around its centre, and a shift along the line from there: points move by the angle times
    // the radius at most, and the gaze turns by what it turns beyond the tree's turn. Nearly always the smaller one.
    const glm::dvec3 a = from.eye - centre, b = to.eye - centre;
    const double da = glm::length(a), db = glm::length(b);
    if (da > radius && db > radius) {
        const double angle = angle_between(a, b);
        double turned = angle * radius + std::abs(db - da);
        if (from.gaze) {
            const glm::dvec3 axis = glm::cross(a, b);
            const double sine = glm::length(axis);
            glm::dvec3 gaze = *from.gaze;
            if (sine > 0) { // Rodrigues' formula
                const glm::dvec3 k = axis / sine;
                gaze = gaze * std::cos(angle) + glm::cross(k, gaze) * std::sin(angle) + k * (glm::dot(k, gaze) * (1 - std::cos(angle)));
            }
            turned += length_per_radian * angle_between(gaze, *to.gaze);
        }
        motion.position = std::min(motion.position, turned);
    }
    for (std::size_t f = 0; f < from.frusta.size(); ++f) {
        const auto &before = from.frusta[f].planes, &after = to.frusta[f].planes;
        if (before.size() != after.size()) return jump;
        for (std::size_t p = 0; p < before.size(); ++p) {
            const glm::dvec3 turn = after[p].normal - before[p].normal;
            const double change = std::abs(glm::dot(turn, centre) + after[p].offset - before[p].offset) + glm::length(turn) * radius;
            motion.facing = std::max(motion.facing, change);
        }
    }
    // Rounding of all this in double, far below what the slacks leave for floats; a comparison with NaN must not stand still.
    motion.position *= 1 + 1e-9;
    motion.facing *= 1 + 1e-9;
    return std::isnan(motion.position + motion.facing) ? jump : motion;
}

} // namespace unseen::vdtree
