#include "fold_tester.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <glm/geometric.hpp>

#include "facing_gap.h"

namespace unseen::vdtree {

namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr float pi = std::numbers::pi_v<float>;

// Slacks are shortened by these, so that rounding in a later test cannot change a verdict before its time. Shares of the
// distance to the eye: a dozen roundings of a float; the facing gap sums a few dozen products.
constexpr float position_rounding = 2e-6f;
constexpr float facing_rounding = 2e-5f;
// Radians: angles come from cosines in floats, which near 1 tell angles apart to about half of this.
constexpr float angle_rounding = 1e-3f;
// The eye moves by at most this share of its distance before a node with a gaze is tested again; see turn_of().
constexpr float longest_path = 0.5f;

// Abramowitz and Stegun 4.4.46; error below 2e-8 radians but for the cosine's own.
float angle_of_cosine(float cosine) {
    const float x = std::min(std::abs(cosine), 1.0f);
    const float series =
        1.5707963050f +
        x * (-0.2145988016f +
             x * (0.0889789874f +
                  x * (-0.0501743046f +
                       x * (0.0308918810f + x * (-0.0170881256f + x * (0.0066700901f - x * 0.0012624911f))))));
    const float angle = std::sqrt(1 - x) * series;
    return cosine < 0 ? pi - angle : angle;
}
float angle_of_sine(float sine) { return pi / 2 - angle_of_cosine(sine); }

} // namespace

// A node whose verdict depends on what it faces.
struct FoldTester::Candidate {
    std::size_t place; // among the verdicts
    NodeId node;
    glm::vec3 to_eye;          // from the ring's centre
    float radius, distance;    // of the ring's sphere
    float gap, length, eccentricity;
    float inside_slack; // how far the frustum's planes are
};

FoldTester::FoldTester(const VertexTree& tree, const DistanceCriterion& criterion, bool cull_back_faces)
    : tree_(tree), criterion_(criterion), cull_back_faces_(cull_back_faces) {}

void FoldTester::look_from(const Viewpoint& viewpoint, float threshold, double length_per_radian) {
    eye_ = viewpoint.eye;
    has_gaze_ = viewpoint.gaze.has_value() && criterion_.uses_gaze();
    if (has_gaze_) gaze_ = glm::vec3(*viewpoint.gaze);
    inverse_threshold_ = 1 / threshold;
    inverse_bin_ = static_cast<float>(180 / (std::numbers::pi * criterion_.parts().bin_degrees));
    turn_per_length_ = static_cast<float>(1 / length_per_radian);
    frusta_.clear();
    for (const Frustum& frustum : viewpoint.frusta) {
        frusta_.emplace_back();
        for (const Plane& plane : frustum.planes)
            frusta_.back().push_back(
                {glm::vec3(plane.normal), static_cast<float>(glm::dot(plane.normal, eye_) + plane.offset)});
    }
}

float FoldTester::distance_of(std::uint16_t row, std::size_t bin, float length) const {
    const float reach = criterion_.parts().reach[row * criterion_.parts().eccentricity_bins + bin];
    if (reach >= DistanceCriterion::always_visible) return infinity;
    if (reach <= DistanceCriterion::never_visible) return -infinity;
    return length * reach * inverse_threshold_;
}

std::size_t FoldTester::bin_of(float eccentricity) const {
    if (!has_gaze_ || !(eccentricity > 0)) return 0;
    const float bin = eccentricity * inverse_bin_;
    const std::size_t last = criterion_.parts().eccentricity_bins - 1;
    return bin < static_cast<float>(last) ? static_cast<std::size_t>(bin) : last;
}

// By how much the eccentricity of a sphere's nearest point can change while the position clock advances by `path`: the gaze
// turns by path / length_per_radian, and a point at least `gap` away shifts by asin(path / gap) < 1.05 path / gap for steps up
// to half the gap, whose later ones start from half the gap.
float FoldTester::turn_of(float path, float gap) const {
    return path * (turn_per_length_ + 2.1f / gap) + angle_rounding;
}

// How far the clock may advance with the node still beyond the distance of its class.
float FoldTester::folded_slack(std::uint16_t row, float length, float gap, float eccentricity) const {
    const float here = gap - distance_of(row, bin_of(eccentricity), length);
    if (!has_gaze_) return here;
    float best = 0;
    for (float path = std::min(here, longest_path * gap); path > 0 && best < path / 4; path /= 4) {
        const float there = gap - distance_of(row, bin_of(eccentricity - turn_of(path, gap)), length);
        best = std::max(best, std::min(path, there));
        if (path < 0.01f * here) break;
    }
    return best;
}

// How far the clock may advance with the node still within the distance of its class.
float FoldTester::unfolded_slack(std::uint16_t row, float length, float gap, float eccentricity) const {
    const float here = distance_of(row, bin_of(eccentricity), length) - gap;
    if (!has_gaze_) return here;
    // Wherever the gaze goes.
    float best = std::max(0.0f, distance_of(row, criterion_.parts().eccentricity_bins - 1, length) - gap);
    if (!(gap > 0)) return best;
    for (float path = std::min(here, longest_path * gap); path > 0 && best < path / 4; path /= 4) {
        const float there = distance_of(row, bin_of(eccentricity + turn_of(path, gap)), length) - gap;
        best = std::max(best, std::min(path, there));
        if (path < 0.01f * here) break;
    }
    return best;
}

// Whether a sphere is outside all frusta, and how far the heights over their planes may change before that changes.
bool FoldTester::is_outside(glm::vec3 to_centre, float radius, float& slack) const {
    float outside_slack = infinity, inside_slack = -infinity;
    bool outside_all = true;
    for (const std::vector<FloatPlane>& frustum : frusta_) {
        float lowest = infinity; // height of the sphere's top over the planes
        for (const FloatPlane& plane : frustum)
            lowest = std::min(lowest, glm::dot(plane.normal, to_centre) + plane.offset + radius);
        if (lowest < 0) outside_slack = std::min(outside_slack, -lowest);
        else {
            outside_all = false;
            inside_slack = std::max(inside_slack, lowest);
        }
    }
    slack = outside_all ? outside_slack : inside_slack;
    return outside_all;
}

void FoldTester::test(std::span<const NodeId> nodes, std::span<Verdict> verdicts) const {
    const DistanceCriterion::Parts& parts = criterion_.parts();
    const auto bounds = tree_.bounds();
    const auto support = tree_.support_spheres();
    const bool by_support = parts.spheres == DistanceCriterion::Spheres::support;
    const bool has_classes = !parts.classes.empty(), has_lengths = !parts.lengths.empty();
    const bool has_frusta = !frusta_.empty(), has_silhouettes = criterion_.uses_silhouettes();
    std::array<Candidate, facing_lanes> candidates;
    std::size_t waiting = 0;

    for (std::size_t i = 0; i < nodes.size(); ++i) {
        const NodeId node = nodes[i];
        const Sphere& sphere = by_support ? support[node] : bounds[node].ring;
        // The difference in double: far from the origin, and near the eye, floats would lose it.
        const glm::vec3 to_eye(eye_ - glm::dvec3(sphere.centre));
        const float distance = glm::length(to_eye), gap = distance - sphere.radius;
        const float rounding = position_rounding * (distance + sphere.radius);
        const FoldClass row = has_classes ? parts.classes[node] : FoldClass{};
        const float length = has_lengths ? parts.lengths[node] : sphere.radius;
        Verdict& verdict = verdicts[i];

        float inside_slack = infinity;
        if (has_frusta) {
            const Sphere& ring = bounds[node].ring;
            float slack;
            if (is_outside(glm::vec3(glm::dvec3(ring.centre) - eye_), ring.radius, slack)) {
                verdict = {std::max(0.0f, slack - rounding), infinity, 0, false};
                continue;
            }
            inside_slack = slack;
        }
        float eccentricity = 0;
        if (has_gaze_ && gap > 0) {
            const float towards = -glm::dot(to_eye, gaze_) / distance;
            eccentricity = std::max(0.0f, angle_of_cosine(towards) - angle_of_sine(sphere.radius / distance));
        }
        const std::size_t bin = bin_of(eccentricity);
        const float interior = distance_of(row.interior, bin, length);
        const float silhouette = has_silhouettes ? distance_of(row.silhouette, bin, length) : interior;
        const bool facing_decides = cull_back_faces_ ? gap < silhouette : has_silhouettes && interior <= gap && gap < silhouette;
        if (facing_decides) {
            candidates[waiting++] = {i, node, to_eye, sphere.radius, distance, gap, length, eccentricity, inside_slack};
            if (by_support) {
                Candidate& candidate = candidates[waiting - 1];
                candidate.to_eye = glm::vec3(eye_ - glm::dvec3(bounds[node].ring.centre));
                candidate.radius = bounds[node].ring.radius;
                candidate.distance = glm::length(candidate.to_eye);
            }
            if (waiting == facing_lanes) {
                test_facing(candidates, verdicts);
                waiting = 0;
            }
            continue;
        }
        // Costs are distances over the threshold's, times the threshold.
        const float scale = 1 / (inverse_threshold_ * std::max(gap, 0.0f));
        const bool unfolded = gap < interior;
        const float slack = unfolded ? std::min(unfolded_slack(row.interior, length, gap, eccentricity), inside_slack)
                                     : folded_slack(has_silhouettes ? row.silhouette : row.interior, length, gap, eccentricity);
        const float reach = unfolded ? interior : silhouette;
        verdict = {std::max(0.0f, slack - rounding), infinity, reach > 0 ? reach * scale : 0.0f, unfolded};
    }
    if (waiting > 0) test_facing(std::span(candidates).first(waiting), verdicts);
}

void FoldTester::test_facing(std::span<const Candidate> candidates, std::span<Verdict> verdicts) const {
    const DistanceCriterion::Parts& parts = criterion_.parts();
    const auto bounds = tree_.bounds();
    FacingBatch batch;
    FacingGaps gaps;
    for (std::size_t lane = 0; lane < facing_lanes; ++lane) {
        const Candidate& c = candidates[std::min(lane, candidates.size() - 1)];
        batch.set(lane, bounds[c.node].slabs, c.to_eye.x, c.to_eye.y, c.to_eye.z, c.radius);
    }
    facing_gaps(batch, gaps);
    for (std::size_t lane = 0; lane < candidates.size(); ++lane) {
        const Candidate& c = candidates[lane];
        const FoldClass row = parts.classes.empty() ? FoldClass{} : parts.classes[c.node];
        float front = gaps.front[lane], back = gaps.back[lane];
        if (bounds[c.node].flags & irregular_ring) front = back = -infinity; // an outline from everywhere
        else if (bounds[c.node].slabs.empty()) front = infinity, back = -infinity; // no triangle with an area
        const bool faces_away = cull_back_faces_ && back > 0;
        const bool is_silhouette = !(front > 0) && !(back > 0);
        const std::uint16_t used = is_silhouette ? row.silhouette : row.interior;
        const float reach = distance_of(used, bin_of(c.eccentricity), c.length);
        const bool unfolded = !faces_away && c.gap < reach;

        Verdict verdict;
        verdict.unfolded = unfolded;
        if (faces_away) {
            verdict.position_slack = infinity;
            verdict.facing_slack = back;
        } else if (unfolded) {
            verdict.position_slack = std::min(unfolded_slack(used, c.length, c.gap, c.eccentricity), c.inside_slack);
            verdict.facing_slack = is_silhouette ? std::min(-front, -back) : std::max(front, back);
            // As an interior one it would be unfolded, too, unless it faces away.
            if (c.gap < distance_of(row.interior, bin_of(c.eccentricity), c.length))
                verdict.facing_slack = cull_back_faces_ ? -back : infinity;
        } else {
            verdict.position_slack = folded_slack(used, c.length, c.gap, c.eccentricity);
            verdict.facing_slack = std::max(front, back);
        }
        verdict.position_slack = std::max(0.0f, verdict.position_slack - position_rounding * (c.distance + c.radius));
        verdict.facing_slack = std::max(0.0f, verdict.facing_slack - facing_rounding * c.distance);
        const float scale = 1 / (inverse_threshold_ * std::max(c.gap, 0.0f));
        verdict.cost = faces_away || !(reach > 0) ? 0.0f : reach * scale;
        verdicts[c.place] = verdict;
    }
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
            motion.position = std::max(motion.position, change);
        }
    }
    // Rounding of all this in double, far below what the slacks leave for floats; a comparison with NaN must not stand still.
    motion.position *= 1 + 1e-9;
    motion.facing *= 1 + 1e-9;
    return std::isnan(motion.position + motion.facing) ? jump : motion;
}

} // namespace unseen::vdtree
