#include "cut/kernel/fold_tester.h"

#include <limits>
#include <numbers>
#include <numeric>

#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/node_bits.h>

#include <unseen/vdtree/internal/simd.h>

namespace unseen::vdtree {

namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

// In two floats each.
void split(const glm::dvec3& point, float (&high)[3], float (&low)[3]) {
    for (int k = 0; k < 3; ++k) {
        high[k] = static_cast<float>(point[k]);
        low[k] = static_cast<float>(point[k] - static_cast<double>(high[k]));
    }
}

// The least rotation from one unit direction to another.
glm::dquat rotation_between(const glm::dvec3& a, const glm::dvec3& b) {
    const double cosine = glm::dot(a, b);
    if (cosine > -1 + 1e-12) return glm::normalize(glm::dquat(1 + cosine, glm::cross(a, b)));
    const glm::dvec3 other = std::abs(a.x) < 0.5 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
    return {0, glm::normalize(glm::cross(a, other))};
}
double angle_of(const glm::dquat& rotation) {
    return 2 * std::atan2(glm::length(glm::dvec3(rotation.x, rotation.y, rotation.z)), std::abs(rotation.w));
}

std::array<const FoldCandidate*, kernel_lanes> lanes_of(std::span<const FoldCandidate> batch) {
    std::array<const FoldCandidate*, kernel_lanes> lanes{};
    for (std::size_t i = 0; i < batch.size(); ++i) lanes[i] = &batch[i];
    return lanes;
}

} // namespace

FoldTester::FoldTester(const VertexTree& tree, const DistanceCriterion& criterion, bool cull_back_faces,
                       float threshold, bool least_costs)
    : CostSource(tree), criterion_(criterion) {
    const DistanceCriterion::Parts& parts = criterion.parts();
    const auto data_of = [](const auto& values) { return values.empty() ? nullptr : values.data(); };
    arrays_ = {tree.bounds().data(),
               parts.spheres == DistanceCriterion::Spheres::support ? tree.support_spheres().data() : nullptr,
               data_of(parts.classes),
               data_of(parts.facing),
               data_of(parts.lengths),
               data_of(parts.silhouette_lengths),
               data_of(criterion.reach().octaves)};
    const bool has_least_costs = least_costs && !parts.least_cost.empty();
    switch_distance_.resize(parts.switch_distance.size());
    for (std::size_t i = 0; i < parts.switch_distance.size(); ++i) {
        const bool always = parts.switch_distance[i] >= DistanceCriterion::always_visible ||
                            (has_least_costs && parts.least_cost[i] > threshold);
        const bool never = parts.switch_distance[i] <= DistanceCriterion::never_visible;
        switch_distance_[i] = never ? -infinity : always ? infinity : parts.switch_distance[i];
    }
    view_.switch_distance = switch_distance_;
    view_.bins = static_cast<std::int32_t>(parts.eccentricity_bins);
    view_.bins_per_radian = static_cast<float>(180 / (std::numbers::pi * parts.bin_degrees));
    view_.inverse_threshold = 1 / threshold;
    view_.reach = criterion.reach().longest;
    view_.near_ones_too = cull_back_faces;
    view_.is_inside_out = tree.closedness() == Closedness::closed_inward;
    view_.nobody = !cull_back_faces && !criterion.uses_silhouettes();
    if (parts.lit) lit_.emplace(tree, *parts.lit, switch_distance_, parts.eccentricity_bins);
}

void FoldTester::look_from(const Viewpoint& viewpoint, double length_per_radian) {
    split(viewpoint.eye, view_.eye_high, view_.eye_low);
    view_.spread = std::nextafter(static_cast<float>(viewpoint.eye_spread),
                                  viewpoint.eye_spread > 0 ? infinity : 0.0f); // not less than it is
    view_.has_gaze = viewpoint.gaze.has_value() && criterion_.uses_gaze();
    if (view_.has_gaze) {
        const glm::vec3 gaze(glm::normalize(*viewpoint.gaze));
        for (int k = 0; k < 3; ++k) view_.gaze[k] = gaze[k];
    }
    view_.planes.clear();
    view_.first_plane.clear();
    for (const Frustum& frustum : viewpoint.frusta) {
        view_.first_plane.push_back(view_.planes.size());
        for (const Plane& plane : frustum) {
            const glm::vec3 n(plane.normal);
            view_.planes.push_back(
                {{n.x, n.y, n.z}, static_cast<float>(glm::dot(plane.normal, viewpoint.eye) + plane.offset)});
        }
    }
    view_.first_plane.push_back(view_.planes.size());
    view_.occluders.clear();
    for (const Sphere& occluder : viewpoint.occluders) {
        const glm::vec3 towards(glm::dvec3(occluder.centre) - viewpoint.eye);
        view_.occluders.push_back({{towards.x, towards.y, towards.z}, occluder.radius});
    }
    view_.length_per_turn = static_cast<float>(length_per_radian / 2);
    costs_view_ = view_;
    costs_view_.everybody = true;
    if (lit_) lit_->look_from(viewpoint, length_per_radian);
}

FoldCandidate FoldTester::candidate(NodeId node) const {
    const NodeBounds& around = arrays_.bounds[node];
    FoldCandidate candidate;
    candidate.sphere = arrays_.support ? arrays_.support[node] : around.ring;
    candidate.length = arrays_.lengths ? arrays_.lengths[node] : candidate.sphere.radius;
    candidate.silhouette_length = arrays_.silhouette_lengths ? arrays_.silhouette_lengths[node] : candidate.length;
    if (arrays_.classes) candidate.rows = arrays_.classes[node];
    candidate.ring = around.ring;
    candidate.slabs = arrays_.facing ? arrays_.facing[node] : around.slabs;
    candidate.flags = around.flags & (irregular_ring | translucent_ring);
    if (arrays_.reach) candidate.flags = static_cast<std::uint8_t>(candidate.flags | arrays_.reach[node] << 2);
    candidate.node = node;
    return candidate;
}

void FoldTester::prefetch(NodeId node) const {
    vdtree::prefetch(arrays_.bounds + node);
    if (arrays_.support) vdtree::prefetch(arrays_.support + node);
    if (arrays_.classes) vdtree::prefetch(arrays_.classes + node);
    if (arrays_.facing) vdtree::prefetch(arrays_.facing + node);
    if (arrays_.lengths) vdtree::prefetch(arrays_.lengths + node);
    if (arrays_.silhouette_lengths) vdtree::prefetch(arrays_.silhouette_lengths + node);
    if (arrays_.reach) vdtree::prefetch(arrays_.reach + node);
    if (lit_) lit_->prefetch(node);
}

void FoldTester::test(std::span<const FoldCandidate> candidates, std::span<const std::uint32_t> which,
                      std::size_t first, TestBatch& tested) const {
    constexpr std::size_t ahead = 2 * kernel_lanes; // candidates between a prefetch and its use
    const std::size_t count = std::min(kernel_lanes, which.size() - first);
    for (std::size_t i = first == 0 ? 0 : first + ahead; i < std::min(first + ahead + kernel_lanes, which.size()); ++i)
        vdtree::prefetch(&candidates[which[i]]);
    std::array<const FoldCandidate*, kernel_lanes> lanes;
    for (std::size_t i = 0; i < count; ++i) lanes[i] = &candidates[which[first + i]];
    if (has_moving_lights())
        for (std::size_t i = first + kernel_lanes; i < std::min(first + 2 * kernel_lanes, which.size()); ++i)
            lit_->prefetch(candidates[which[i]].node);
    test({lanes.data(), count}, tested);
}

void FoldTester::test(std::span<const FoldCandidate> candidates, std::span<Verdict> verdicts) const {
    TestBatch tested;
    for (std::size_t first = 0; first < candidates.size(); first += kernel_lanes) {
        const auto batch = candidates.subspan(first, std::min(kernel_lanes, candidates.size() - first));
        test(Lanes(lanes_of(batch)).first(batch.size()), tested);
        for (std::size_t i = 0; i < batch.size(); ++i) verdicts[first + i] = tested[i];
    }
}

void FoldTester::decide(std::span<const NodeId> nodes, std::uint64_t* unfolded) const {
    if (!lit_) return fold_kernel.decide(view_, arrays_, nodes, unfolded);
    std::fill_n(unfolded, words_for(nodes.size()), 0);
    static_assert(64 % kernel_lanes == 0);
    for_each_batch(view_, nodes, [&](std::size_t first, std::size_t count, const FoldBatch& batch) {
        const std::uint64_t used = (std::uint64_t{1} << count) - 1;
        unfolded[first / 64] |= (batch.unfolded & used) << (first % 64);
    });
}

void FoldTester::decide_range(NodeId first, std::size_t count, std::uint64_t* unfolded) const {
    if (!lit_) return fold_kernel.decide_range(view_, arrays_, first, count, unfolded);
    std::vector<NodeId> nodes(count);
    std::iota(nodes.begin(), nodes.end(), first);
    decide(nodes, unfolded);
}

void FoldTester::find_costs(std::span<const NodeId> nodes, const NodeCosts& costs) const {
    if (!lit_) return fold_kernel.find_costs(costs_view_, arrays_, cost_tables(), nodes, costs);
    std::fill_n(costs.unfolded, words_for(nodes.size()), 0);
    for_each_batch(costs_view_, nodes, [&](std::size_t first, std::size_t count, const FoldBatch& batch) {
        alignas(64) float cost[kernel_lanes], seen_cost[kernel_lanes];
        fold_kernel.find_batch_costs(costs_view_, cost_tables(), batch, cost, seen_cost);
        std::copy_n(cost, count, costs.cost + first);
        std::copy_n(seen_cost, count, costs.seen_cost + first);
        const std::uint64_t used = (std::uint64_t{1} << count) - 1;
        costs.unfolded[first / 64] |= (batch.unfolded & used) << (first % 64);
    });
}

CostTables FoldTester::cost_tables() const {
    const DistanceCriterion::Parts& parts = criterion_.parts();
    return {parts.switch_distance.data(), parts.least_cost.empty() ? nullptr : parts.least_cost.data()};
}

void FoldTester::find_cost_bounds(std::span<const NodeId> nodes, const float* folded_at, float* cost,
                                  float* seen_cost) const {
    fold_kernel.find_cost_bounds(costs_view_, arrays_, cost_tables(), nodes, folded_at ? *folded_at : infinity, cost,
                                 seen_cost);
}

void FoldTester::decide_at(float threshold, std::span<const NodeId> nodes, std::uint64_t* unfolded) const {
    KernelView view = view_;
    view.inverse_threshold = 1 / threshold;
    fold_kernel.decide(view, arrays_, nodes, unfolded);
}

// ---- with lights

// The verdicts on nodes, sixteen at a time: f(place of the first, how many, batch).
template <class F>
void FoldTester::for_each_batch(const KernelView& view, std::span<const NodeId> nodes, F&& f) const {
    std::array<FoldCandidate, kernel_lanes> candidates;
    const auto lanes = lanes_of(candidates);
    for (std::size_t first = 0; first < nodes.size(); first += kernel_lanes) {
        // Nodes lie anywhere in a large tree: the next ones are on their way while these are tested.
        constexpr std::size_t ahead = kernel_lanes;
        const std::size_t count = std::min(kernel_lanes, nodes.size() - first);
        for (std::size_t i = first + ahead; i < std::min(first + ahead + kernel_lanes, nodes.size()); ++i)
            prefetch(nodes[i]);
        for (std::size_t i = 0; i < count; ++i) candidates[i] = candidate(nodes[first + i]);
        LitFindings lit;
        FoldBatch batch;
        find_lit_verdicts(view, Lanes(lanes).first(count), lit, batch);
        f(first, count, batch);
    }
}

void FoldTester::find_lit_rows(Lanes lanes, LitFindings& lit) const {
    for (std::size_t i = 0; i < kernel_lanes; ++i) { // unused lanes repeat the last
        const FoldCandidate& of = *lanes[std::min(i, lanes.size() - 1)];
        lit_->set(i, of.node, of.ring, lit);
    }
    lit_->find_rows(lit);
    for (std::size_t i = 0; i < lanes.size(); ++i) {
        if (!(lanes[i]->flags & translucent_ring)) continue;
        lit.translucent |= 1u << i;
        lit.row[i] = lit_->silhouette_row();
    }
}

FoldClass FoldTester::lit_rows(const LitFindings& lit, std::size_t lane) const {
    return {static_cast<std::uint16_t>(lit.row[lane]), static_cast<std::uint16_t>(lit_->silhouette_row())};
}

void FoldTester::find_still_rows(std::span<FoldCandidate> candidates) const {
    if (!lit_ || do_lights_move_) return;
    for (std::size_t first = 0; first < candidates.size(); first += kernel_lanes) {
        const auto batch = candidates.subspan(first, std::min(kernel_lanes, candidates.size() - first));
        LitFindings lit;
        find_lit_rows(Lanes(lanes_of(batch)).first(batch.size()), lit);
        for (std::size_t i = 0; i < batch.size(); ++i) batch[i].rows = lit_rows(lit, i);
    }
}

// By the rows that lights give.
void FoldTester::find_lit_verdicts(const KernelView& view, Lanes lanes, LitFindings& lit, FoldBatch& batch) const {
    find_lit_rows(lanes, lit);
    std::array<FoldCandidate, kernel_lanes> candidates;
    for (std::size_t i = 0; i < lanes.size(); ++i) {
        candidates[i] = *lanes[i];
        candidates[i].rows = lit_rows(lit, i);
    }
    fold_kernel.find_verdicts(view, Lanes(lanes_of(candidates)).first(lanes.size()), batch);
}

void FoldTester::test(Lanes lanes, TestBatch& tested) const {
    if (!has_moving_lights()) return fold_kernel.test(view_, lanes, tested);
    LitFindings lit;
    FoldBatch batch;
    find_lit_verdicts(view_, lanes, lit, batch);
    leave_room_for_lights(lit, batch);
    fold_kernel.find_slacks(view_, batch, tested);
    std::copy_n(lit.slack, kernel_lanes, tested.light_slack);
}

// Parts what is left between a verdict and its contrary among the lights' motion and the eye's: the rows from here on
// are those that the lights may lead to within their slack.
void FoldTester::leave_room_for_lights(LitFindings& lit, FoldBatch& batch) const {
    alignas(64) float units[kernel_lanes];
    for (std::size_t i = 0; i < kernel_lanes; ++i) {
        units[i] = std::max(batch.length[i], least_length) * view_.inverse_threshold;
        // In lengths, with the rounding of the comparison that the verdict comes from.
        constexpr float rounding = 1e-6f;
        const std::int32_t is_near = (batch.is_near >> i) & 1;
        lit.gap[i] = batch.gap[i] / units[i] * (is_near ? 1 + rounding : 1 - rounding);
        lit.is_unfolded[i] = is_near;
    }
    std::copy_n(batch.bin, kernel_lanes, lit.bin);
    lit_->leave_room(lit);
    const std::uint32_t is_out = ~batch.is_inside | batch.is_away, is_outline = batch.unfolded & ~batch.is_near;
    for (std::size_t i = 0; i < kernel_lanes; ++i) {
        if (((is_out | is_outline | lit.translucent) >> i) & 1) { // not by its luminance
            lit.slack[i] = infinity;
            continue;
        }
        const auto switch_distance = [&](std::int32_t row) {
            return view_.switch_distance[static_cast<std::size_t>(row * view_.bins + batch.bin[i])];
        };
        batch.interior_row[i] = lit.farthest_row[i];
        batch.interior[i] = units[i] * switch_distance(batch.interior_row[i]);
        const float outline = std::max(batch.silhouette_length[i], least_length) * view_.inverse_threshold *
                              switch_distance(batch.silhouette_row[i]);
        batch.silhouette[i] = std::max(batch.interior[i], outline);
    }
}

// The world may turn so that the gaze comes back alone, or the eye around the tree first. What makes the tree move less is
// better.
GazeMotion gaze_motion(const VertexTree& tree, const Viewpoint& from, const Viewpoint& to) {
    const Sphere& root = tree.bounds()[VertexTree::root()].ring;
    const glm::dvec3 before = glm::dvec3(root.centre) - from.eye, after = glm::dvec3(root.centre) - to.eye;
    const glm::dvec3 gaze_before = glm::normalize(*from.gaze), gaze = glm::normalize(*to.gaze);
    glm::dquat turn = rotation_between(gaze, gaze_before);
    const auto move_of = [&](const glm::dquat& q) {
        return glm::length(q * after - before) + angle_of(q) * static_cast<double>(root.radius);
    };
    if (glm::length(before) > 0 && glm::length(after) > 0) {
        const glm::dquat around = rotation_between(glm::normalize(after), glm::normalize(before));
        const glm::dquat other = rotation_between(around * gaze, gaze_before) * around;
        if (move_of(other) < move_of(turn)) turn = other;
    }
    GazeMotion motion;
    split(from.eye, motion.from_high, motion.from_low);
    split(to.eye, motion.to_high, motion.to_low);
    for (int k = 0; k < 3; ++k) motion.gaze[k] = static_cast<float>(gaze[k]);
    const glm::dmat3 columns = glm::mat3_cast(turn);
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column) motion.turn[row][column] = static_cast<float>(columns[column][row]);
    motion.turned = rounded_up(angle_of(turn));
    return motion;
}

Motion FoldTester::motion(const VertexTree& tree, const Viewpoint& from, const Viewpoint& to,
                          double length_per_radian) {
    constexpr Motion jump{.position = std::numeric_limits<double>::infinity(),
                          .facing = std::numeric_limits<double>::infinity()};
    if (from.gaze.has_value() != to.gaze.has_value() || from.frusta.size() != to.frusta.size() ||
        from.eye_spread != to.eye_spread || from.occluders != to.occluders)
        return jump;
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
    // Seen as a turn of the tree around its centre, and a shift along the line from there: points move by the angle
    // times the radius at most, and the gaze turns by what it turns beyond the tree's turn. Nearly always the smaller
    // one.
    const glm::dvec3 a = from.eye - centre, b = to.eye - centre;
    const double da = glm::length(a), db = glm::length(b);
    if (da > radius && db > radius) {
        const double angle = angle_between(a, b);
        double turned = angle * radius + std::abs(db - da);
        if (from.gaze) {
            const glm::dvec3 gaze = rotation_between(a / da, b / db) * *from.gaze;
            turned += length_per_radian * angle_between(gaze, *to.gaze);
        }
        motion.position = std::min(motion.position, turned);
    }
    for (std::size_t f = 0; f < from.frusta.size(); ++f) {
        const Frustum &before = from.frusta[f], &after = to.frusta[f];
        if (before.size() != after.size()) return jump;
        for (std::size_t p = 0; p < before.size(); ++p) {
            const glm::dvec3 turn = after[p].normal - before[p].normal;
            const double change =
                std::abs(glm::dot(turn, centre) + after[p].offset - before[p].offset) + glm::length(turn) * radius;
            motion.planes = std::max(motion.planes, change);
        }
    }
    // Rounding of all this in double, far below what the slacks leave for floats; a comparison with NaN must not stand
    // still.
    motion.position *= 1 + 1e-9;
    motion.facing *= 1 + 1e-9;
    motion.planes *= 1 + 1e-9;
    return std::isnan(motion.position + motion.facing + motion.planes) ? jump : motion;
}

} // namespace unseen::vdtree
