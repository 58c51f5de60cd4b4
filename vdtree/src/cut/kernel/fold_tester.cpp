#include "cut/kernel/fold_tester.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <utility>

#include <glm/geometric.hpp>

#include "cut/kernel/prefetch.h"

namespace unseen::vdtree {

namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

// Unused lanes repeat the last candidate.
void load(std::span<const FoldCandidate* const> lanes, FoldBatch& batch) {
    const std::size_t last = lanes.size() - 1;
    for (std::size_t i = 0; i < kernel_lanes; ++i) {
        const FoldCandidate& of = *lanes[i < last ? i : last];
        batch.centre[0][i] = of.sphere.centre.x;
        batch.centre[1][i] = of.sphere.centre.y;
        batch.centre[2][i] = of.sphere.centre.z;
        batch.radius[i] = of.sphere.radius;
        batch.length[i] = of.length;
        batch.silhouette_length[i] = of.silhouette_length;
        batch.interior_row[i] = of.rows.interior;
        batch.silhouette_row[i] = of.rows.silhouette;
    }
}

} // namespace

FoldTester::FoldTester(const VertexTree& tree, const DistanceCriterion& criterion, bool cull_back_faces, float threshold, bool least_costs)
    : tree_(tree), criterion_(criterion), cull_back_faces_(cull_back_faces), has_silhouettes_(criterion.uses_silhouettes()) {
    const DistanceCriterion::Parts& parts = criterion.parts();
    const auto data_of = [](const auto& values) { return values.empty() ? nullptr : values.data(); };
    arrays_ = {tree.bounds().data(), parts.spheres == DistanceCriterion::Spheres::support ? tree.support_spheres().data() : nullptr,
               data_of(parts.classes), data_of(parts.facing), data_of(parts.lengths), data_of(parts.silhouette_lengths)};
    const bool has_least_costs = least_costs && !parts.least_cost.empty();
    reach_.resize(parts.reach.size());
    for (std::size_t i = 0; i < reach_.size(); ++i) {
        const bool always = parts.reach[i] >= DistanceCriterion::always_visible || (has_least_costs && parts.least_cost[i] > threshold);
        const bool never = parts.reach[i] <= DistanceCriterion::never_visible;
        reach_[i] = never ? -infinity : always ? infinity : parts.reach[i];
    }
    view_.reach = reach_;
    view_.bins = static_cast<std::int32_t>(parts.eccentricity_bins);
    view_.bins_per_radian = static_cast<float>(180 / (std::numbers::pi * parts.bin_degrees));
    view_.inverse_threshold = 1 / threshold;
    view_.near_ones_too = cull_back_faces;
    view_.is_inside_out = tree.closedness() == Closedness::closed_inward;
    view_.nobody = !cull_back_faces && !has_silhouettes_;
    if (parts.lit) lit_.emplace(tree, *parts.lit, reach_, parts.eccentricity_bins);
}

void FoldTester::look_from(const Viewpoint& viewpoint, double length_per_radian) {
    for (int k = 0; k < 3; ++k) {
        view_.eye_high[k] = static_cast<float>(viewpoint.eye[k]);
        view_.eye_low[k] = static_cast<float>(viewpoint.eye[k] - static_cast<double>(view_.eye_high[k]));
    }
    view_.has_gaze = viewpoint.gaze.has_value() && criterion_.uses_gaze();
    if (view_.has_gaze)
        for (int k = 0; k < 3; ++k) view_.gaze[k] = static_cast<float>((*viewpoint.gaze)[k]);
    view_.planes.clear();
    view_.first_plane.clear();
    for (const Frustum& frustum : viewpoint.frusta) {
        view_.first_plane.push_back(view_.planes.size());
        for (const Plane& plane : frustum.planes) {
            const glm::vec3 n(plane.normal);
            view_.planes.push_back({{n.x, n.y, n.z}, static_cast<float>(glm::dot(plane.normal, viewpoint.eye) + plane.offset)});
        }
    }
    view_.first_plane.push_back(view_.planes.size());
    view_.occluders.clear();
    for (const Sphere& occluder : viewpoint.occluders) {
        const glm::vec3 towards(glm::dvec3(occluder.centre) - viewpoint.eye);
        view_.occluders.push_back({{towards.x, towards.y, towards.z}, occluder.radius});
    }
    view_.turn_per_length = static_cast<float>(1 / length_per_radian);
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
    candidate.flags = around.flags;
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
    if (lit_) lit_->prefetch(node);
}

void FoldTester::test(std::span<const FoldCandidate> candidates, std::span<const std::uint32_t> which, std::size_t first, TestBatch& tested) const {
    constexpr std::size_t ahead = 2 * kernel_lanes; // candidates between a prefetch and its use
    const std::size_t count = std::min(kernel_lanes, which.size() - first);
    for (std::size_t i = first == 0 ? 0 : first + ahead; i < std::min(first + ahead + kernel_lanes, which.size()); ++i)
        vdtree::prefetch(&candidates[which[i]]);
    std::array<const FoldCandidate*, kernel_lanes> lanes;
    for (std::size_t i = 0; i < count; ++i) lanes[i] = &candidates[which[first + i]];
    if (!lit_) return vdtree::test(view_, {lanes.data(), count}, tested);
    for (std::size_t i = first + kernel_lanes; i < std::min(first + 2 * kernel_lanes, which.size()); ++i) lit_->prefetch(candidates[which[i]].node);
    test_in_stages({lanes.data(), count}, tested, nullptr);
}

void FoldTester::test(std::span<const FoldCandidate> candidates, std::span<Verdict> verdicts) const {
    std::array<const FoldCandidate*, kernel_lanes> lanes;
    for (std::size_t first = 0; first < candidates.size(); first += kernel_lanes) {
        const std::size_t count = std::min(kernel_lanes, candidates.size() - first);
        for (std::size_t i = 0; i < count; ++i) lanes[i] = &candidates[first + i];
        test_batch({lanes.data(), count}, &verdicts[first], false);
    }
}

void FoldTester::test(std::span<const NodeId> nodes, std::span<Verdict> verdicts) const { test_nodes(nodes, verdicts, false); }

void FoldTester::test_costs(std::span<const NodeId> nodes, std::span<Verdict> verdicts) const { test_nodes(nodes, verdicts, true); }

// Lights have no short cuts: what they make of nodes is found with all the rest.
void FoldTester::decide(std::span<const NodeId> nodes, std::uint64_t* unfolded) const {
    if (!lit_) return vdtree::decide(view_, arrays_, nodes, unfolded);
    std::array<Verdict, 64> verdicts;
    for (std::size_t first = 0; first < nodes.size(); first += verdicts.size()) {
        const std::size_t count = std::min(verdicts.size(), nodes.size() - first);
        test_nodes(nodes.subspan(first, count), std::span(verdicts).first(count), false);
        std::uint64_t& word = unfolded[first / 64] = 0;
        for (std::size_t i = 0; i < count; ++i) word |= std::uint64_t{verdicts[i].unfolded} << i;
    }
}

void FoldTester::decide_range(NodeId first, std::size_t count, std::uint64_t* unfolded) const {
    if (!lit_) return vdtree::decide_range(view_, arrays_, first, count, unfolded);
    std::vector<NodeId> nodes(count);
    std::iota(nodes.begin(), nodes.end(), first);
    decide(nodes, unfolded);
}

void FoldTester::find_costs(std::span<const NodeId> nodes, const NodeCosts& costs) const {
    if (lit_) {
        std::vector<Verdict> verdicts(nodes.size());
        test_nodes(nodes, verdicts, true);
        std::fill_n(costs.unfolded, (nodes.size() + 63) / 64, 0);
        for (std::size_t i = 0; i < nodes.size(); ++i) {
            costs.cost[i] = verdicts[i].cost;
            costs.seen_cost[i] = verdicts[i].seen_cost;
            costs.unfolded[i / 64] |= std::uint64_t{verdicts[i].unfolded} << (i % 64);
        }
        return;
    }
    vdtree::find_costs(costs_view_, arrays_, cost_tables(), nodes, costs);
}

CostTables FoldTester::cost_tables() const {
    const DistanceCriterion::Parts& parts = criterion_.parts();
    return {parts.reach.data(), parts.least_cost.empty() ? nullptr : parts.least_cost.data()};
}

void FoldTester::find_cost_bounds(std::span<const NodeId> nodes, const float* folded_at, float* cost, float* seen_cost) const {
    vdtree::find_cost_bounds(costs_view_, arrays_, cost_tables(), nodes, folded_at ? *folded_at : infinity, cost, seen_cost);
}

void FoldTester::decide_at(float threshold, std::span<const NodeId> nodes, std::uint64_t* unfolded) const {
    KernelView view = view_;
    view.inverse_threshold = 1 / threshold;
    vdtree::decide(view, arrays_, nodes, unfolded);
}

void FoldTester::test_nodes(std::span<const NodeId> nodes, std::span<Verdict> verdicts, bool costs) const {
    std::array<FoldCandidate, kernel_lanes> candidates;
    std::array<const FoldCandidate*, kernel_lanes> lanes;
    for (std::size_t i = 0; i < kernel_lanes; ++i) lanes[i] = &candidates[i];
    for (std::size_t first = 0; first < nodes.size(); first += kernel_lanes) {
        // Nodes lie anywhere in a large tree: the next ones are on their way while these are tested.
        constexpr std::size_t ahead = kernel_lanes;
        const std::size_t count = std::min(kernel_lanes, nodes.size() - first);
        for (std::size_t i = first + ahead; i < std::min(first + ahead + kernel_lanes, nodes.size()); ++i) prefetch(nodes[i]);
        for (std::size_t i = 0; i < count; ++i) candidates[i] = candidate(nodes[first + i]);
        test_batch({lanes.data(), count}, &verdicts[first], costs);
    }
}

// With a gaze; without, the slack is what is left of the gap.
void FoldTester::find_position_slacks(const FoldBatch& batch, Findings& findings) const {
    SlackBatch asked;
    for (std::size_t i = 0; i < kernel_lanes; ++i) {
        const bool is_silhouette = (findings.silhouettes >> i) & 1;
        asked.inward[i] = (findings.unfolded >> i) & 1 ? 1.0f : -1.0f;
        asked.silhouette_length[i] = is_silhouette ? batch.silhouette_length[i] : batch.length[i];
        asked.silhouette_row[i] = is_silhouette ? batch.silhouette_row[i] : batch.interior_row[i];
    }
    std::copy_n(batch.interior_row, kernel_lanes, asked.row);
    std::copy_n(batch.bin, kernel_lanes, asked.bin);
    std::copy_n(batch.gap, kernel_lanes, asked.gap);
    std::copy_n(batch.eccentricity, kernel_lanes, asked.eccentricity);
    std::copy_n(batch.length, kernel_lanes, asked.length);
    find_slacks(view_, asked);
    std::copy_n(asked.slack, kernel_lanes, findings.position_slack);
}

// By their distances alone most nodes are settled; here are the others.
void FoldTester::find_facings(Lanes candidates, const FoldBatch& batch, bool costs, Findings& findings) const {
    FacingBatch facing;
    std::array<std::uint8_t, kernel_lanes> lanes;
    std::size_t count = 0;
    for (std::uint32_t left = batch.is_asked; left; left &= left - 1) {
        const auto i = static_cast<std::size_t>(std::countr_zero(left));
        const FoldCandidate& of = *candidates[i];
        if (!arrays_.support) {
            facing.set(count, of.slabs, batch.to_eye[0][i], batch.to_eye[1][i], batch.to_eye[2][i], of.ring.radius);
        } else { // another sphere than the one measured
            const auto towards = [&](int k) { return (view_.eye_high[k] - of.ring.centre[k]) + view_.eye_low[k]; };
            facing.set(count, of.slabs, towards(0), towards(1), towards(2), of.ring.radius);
        }
        lanes[count++] = static_cast<std::uint8_t>(i);
    }
    for (std::size_t k = count; k < kernel_lanes; ++k) facing.set(k, NormalSlabs{}, 0, 0, 0, 0);
    FacingGaps gaps;
    facing_gaps(facing, gaps);
    for (std::size_t k = 0; k < count; ++k) {
        const std::size_t i = lanes[k];
        const std::uint32_t bit = 1u << i;
        const FoldCandidate& around = *candidates[i];
        float front = gaps.front[k], back = gaps.back[k];
        if (view_.is_inside_out) std::swap(front, back);
        if (around.flags & irregular_ring) front = back = -infinity;       // an outline from everywhere
        else if (around.slabs.empty()) front = infinity, back = -infinity; // no triangle with an area
        const bool is_silhouette = !(front > 0) && !(back > 0), is_near = batch.is_near & bit;
        if (cull_back_faces_ && back > 0) {
            findings.away |= bit;
            findings.unfolded &= ~bit;
            findings.facing_slack[i] = back;
            continue;
        }
        const bool unfolds = is_near || (is_silhouette && batch.gap[i] < batch.silhouette[i]);
        findings.unfolded = unfolds ? findings.unfolded | bit : findings.unfolded & ~bit;
        // Within the interior's distance nothing but facing away folds it.
        const bool as_silhouette = is_silhouette && (costs || !is_near);
        findings.silhouettes = as_silhouette ? findings.silhouettes | bit : findings.silhouettes & ~bit;
        if (is_near) findings.facing_slack[i] = cull_back_faces_ ? -back : infinity;
        else findings.facing_slack[i] = is_silhouette ? std::min(-front, -back) : std::max(front, back);
    }
}

// The rows that lights give.
void FoldTester::light(Lanes lanes, FoldBatch& batch, LitFindings& lit) const {
    for (std::size_t i = 0; i < kernel_lanes; ++i) {
        const FoldCandidate& of = *lanes[std::min(i, lanes.size() - 1)];
        lit_->set(i, of.node, of.ring, lit);
    }
    lit_->find_rows(lit);
    for (std::size_t i = 0; i < lanes.size(); ++i) {
        if (!(lanes[i]->flags & translucent_ring)) continue;
        lit.translucent |= 1u << i;
        lit.row[i] = lit_->silhouette_row();
    }
    std::copy_n(lit.row, kernel_lanes, batch.interior_row);
    std::fill_n(batch.silhouette_row, kernel_lanes, lit_->silhouette_row());
}

// Parts what is left between a verdict and its contrary among the lights' motion and the eye's: the rows from here on are those that the
// lights may lead to within their slack.
void FoldTester::leave_room_for_lights(LitFindings& lit, FoldBatch& batch, const Findings& findings) const {
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
    const std::uint32_t is_out = ~batch.is_inside | findings.away, is_outline = findings.unfolded & ~batch.is_near;
    for (std::size_t i = 0; i < kernel_lanes; ++i) {
        if (((is_out | is_outline | lit.translucent) >> i) & 1) { // not by its luminance
            lit.slack[i] = infinity;
            continue;
        }
        const auto reach = [&](std::int32_t row) { return view_.reach[static_cast<std::size_t>(row * view_.bins + batch.bin[i])]; };
        batch.interior_row[i] = lit.farthest_row[i];
        batch.interior[i] = units[i] * reach(batch.interior_row[i]);
        const float outline = std::max(batch.silhouette_length[i], least_length) * view_.inverse_threshold * reach(batch.silhouette_row[i]);
        batch.silhouette[i] = std::max(batch.interior[i], outline);
    }
}

void FoldTester::test_batch(Lanes lanes, Verdict* verdicts, bool costs) const {
    TestBatch tested;
    if (lit_ || costs) test_in_stages(lanes, tested, costs ? verdicts : nullptr);
    else vdtree::test(view_, lanes, tested);
    for (std::size_t i = 0; i < lanes.size(); ++i) {
        verdicts[i].position_slack = tested.position_slack[i];
        verdicts[i].facing_slack = tested.facing_slack[i];
        verdicts[i].plane_slack = tested.plane_slack[i];
        verdicts[i].light_slack = lit_ ? tested.light_slack[i] : infinity;
        verdicts[i].unfolded = (tested.unfolded >> i) & 1;
    }
}

// For lights, and for costs, where these are asked for.
void FoldTester::test_in_stages(Lanes lanes, TestBatch& tested, Verdict* costs) const {
    FoldBatch batch;
    load(lanes, batch);
    LitFindings lit;
    if (lit_) light(lanes, batch, lit);
    measure(costs ? costs_view_ : view_, batch);
    batch.is_asked &= (1u << lanes.size()) - 1; // unused lanes are nobody's
    Findings findings;
    findings.unfolded = batch.is_inside & batch.is_near;
    findings.silhouettes = ~batch.is_near;
    std::fill_n(findings.facing_slack, kernel_lanes, infinity);
    if (batch.is_asked) find_facings(lanes, batch, costs, findings);
    if (lit_) leave_room_for_lights(lit, batch, findings);
    if (view_.has_gaze) find_position_slacks(batch, findings);
    finish_slacks(view_, batch, findings);
    std::copy_n(findings.position_slack, kernel_lanes, tested.position_slack);
    std::copy_n(findings.facing_slack, kernel_lanes, tested.facing_slack);
    std::copy_n(findings.plane_slack, kernel_lanes, tested.plane_slack);
    if (lit_) std::copy_n(lit.slack, kernel_lanes, tested.light_slack);
    tested.unfolded = findings.unfolded;
    if (!costs) return;
    if (lit_) std::copy_n(lit.row, kernel_lanes, batch.interior_row);
    for (std::size_t i = 0; i < lanes.size(); ++i) {
        costs[i].cost = costs[i].seen_cost = 0;
        const std::uint32_t bit = 1u << i;
        if ((batch.is_inside & bit) && !(findings.away & bit)) set_costs(costs[i], batch, i, findings.silhouettes & bit);
    }
}

// The thresholds at which the node would just fold.
void FoldTester::set_costs(Verdict& verdict, const FoldBatch& batch, std::size_t lane, bool is_silhouette) const {
    set_costs(verdict, batch.interior_row[lane], batch.bin[lane], batch.length[lane], batch.gap[lane]);
    if (is_silhouette) set_costs(verdict, batch.silhouette_row[lane], batch.bin[lane], batch.silhouette_length[lane], batch.gap[lane]);
}

// Raises the costs to those of one row.
void FoldTester::set_costs(Verdict& verdict, std::int32_t row, std::int32_t bin, float unit, float gap) const {
    const DistanceCriterion::Parts& parts = criterion_.parts();
    const auto entry = static_cast<std::size_t>(row * view_.bins + bin);
    const float reach = parts.reach[entry], length = unit * reach;
    if (!(reach >= 0) || (!(length > 0) && gap > 0)) return; // from nowhere, or from inside only
    const bool always = reach >= DistanceCriterion::always_visible || !(gap > 0);
    const float cost = always ? infinity : length / gap;
    verdict.cost = std::max(verdict.cost, cost);
    verdict.seen_cost = std::max(verdict.seen_cost, parts.least_cost.empty() ? cost : std::max(cost, parts.least_cost[entry]));
}

Motion FoldTester::motion(const VertexTree& tree, const Viewpoint& from, const Viewpoint& to, double length_per_radian) {
    constexpr Motion jump{.position = std::numeric_limits<double>::infinity(),
                          .facing = std::numeric_limits<double>::infinity()};
    if (from.gaze.has_value() != to.gaze.has_value() || from.frusta.size() != to.frusta.size() || from.occluders != to.occluders)
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
            motion.planes = std::max(motion.planes, change);
        }
    }
    // Rounding of all this in double, far below what the slacks leave for floats; a comparison with NaN must not stand still.
    motion.position *= 1 + 1e-9;
    motion.facing *= 1 + 1e-9;
    motion.planes *= 1 + 1e-9;
    return std::isnan(motion.position + motion.facing + motion.planes) ? jump : motion;
}

} // namespace unseen::vdtree
