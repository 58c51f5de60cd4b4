#include "cut/cut_follower.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/light_bounds.h>

#include "cut/budget.h"

namespace unseen::vdtree {

namespace {

// Clocks restart when they have run this many times the distance to the tree, so that deadlines in floats stay fine
// enough.
constexpr double longest_run = 16;
// With more than this share of the watched nodes due, deciding anew from the root down is cheaper: there are some more
// tests, at half of the price.
constexpr double most_due = 0.6;
// After larger steps from a cut without deadlines, deadlines would not be worth making. In lengths for a radian, like
// longest_step.
constexpr double step_worth_deadlines = 0.03;
// Beyond this step a good part of all verdicts would be due anyway. In lengths for a radian: twice the tree's distance.
constexpr double longest_step = 0.125;
constexpr double longest_light_step = 0.5; // radians; likewise
// A budget that holds everything has the threshold 0; this stands for it.
constexpr float least_threshold = 1e-30f;
constexpr double longest_limit_ms = 1e9; // more is no limit
// Share of a fresh start's time for decisions; the rest is for changing the cut.
constexpr double deciding_share = 0.6;

} // namespace

bool CutFollower::is_same_request(const DistanceCriterion& criterion, const FollowOptions& options) const {
    return is_tracking_ && criterion.id() == criterion_ && options.cull_back_faces == options_.cull_back_faces &&
           options.threshold == options_.threshold && options.triangle_budget == options_.triangle_budget &&
           options.fill_budget == options_.fill_budget && options.hysteresis == options_.hysteresis;
}

void CutFollower::prepare(const DistanceCriterion& criterion, const FollowOptions& options) {
    criterion_ = criterion.id();
    options_ = options;
    threshold_ = options.threshold;
    is_tracking_ = false;
    make_tester(criterion);
}

// Also where the values are the same, but another object has them: the one that was tested may be gone.
void CutFollower::make_tester(const DistanceCriterion& criterion) {
    const bool has_budget = options_.triangle_budget.has_value();
    const bool do_lights_move = tester_ && tester_->has_moving_lights() && is_tracking_;
    tester_.emplace(tree_, criterion, options_.cull_back_faces, threshold_, !has_budget);
    tester_->let_lights_move(do_lights_move); // they stand still until they move
    tested_ = criterion.object_id();
    watches_ancestors_ = !criterion.is_monotone();
}

AdjustStats CutFollower::follow(CutState& cut, const DistanceCriterion& criterion, const Viewpoint& viewpoint,
                                const FollowOptions& options) {
    stats_ = {};
    time_limit_.reset();
    if (options.milliseconds && *options.milliseconds < longest_limit_ms) {
        begin_ = std::chrono::steady_clock::now();
        time_limit_ = begin_ + std::chrono::nanoseconds(static_cast<std::int64_t>(*options.milliseconds * 1e6));
    }
    const bool is_same = is_same_request(criterion, options);
    if (!is_same) prepare(criterion, options);
    else if (tested_ != criterion.object_id()) make_tester(criterion);
    Motion motion = is_same ? FoldTester::motion(tree_, viewpoint_, viewpoint, length_per_radian_)
                            : Motion{.position = std::numeric_limits<double>::infinity()};
    if (criterion.parts().lit) motion = with_lights(motion, viewpoint, is_same);
    const bool is_still =
        is_same && motion.position == 0 && motion.facing == 0 && motion.planes == 0 && motion.light == 0;
    settler_.keep_costs_if(is_still);
    const float cost_before = max_fold_cost_;
    if (is_still && was_complete_) { // nothing can have changed
        cut.begin_changes();
        cut.end_changes(stats_);
    } else if (options.triangle_budget) {
        follow_budget(cut, viewpoint, motion);
    } else {
        follow_threshold(cut, viewpoint, motion);
    }
    viewpoint_ = viewpoint;
    was_complete_ = stats_.is_complete;
    // What is known of a view holds while it stands still.
    if (is_still && !stats_.is_complete) max_fold_cost_ = std::min(max_fold_cost_, std::max(cost_before, threshold_));
    stats_.node_tests += settler_.take_node_tests();
    stats_.max_fold_cost = max_fold_cost_;
    return stats_;
}

// Lights that begin to move are a jump: up to then verdicts held for where they were. So are lights at another place
// after a jump.
Motion CutFollower::with_lights(Motion motion, const Viewpoint& viewpoint, bool is_same) {
    const double turn = light_motion(tree_, viewpoint_.lighting, viewpoint_.eye, viewpoint.lighting, viewpoint.eye);
    motion.light = light_weight * length_per_radian_ * turn;
    const bool begins = turn > 0 && !tester_->has_moving_lights();
    if (!(turn < longest_light_step) || begins) motion.position = std::numeric_limits<double>::infinity();
    if (is_same && turn > 0) tester_->let_lights_move(true);
    return motion;
}

// For a fresh start: nothing watched, and a length for turns of the gaze.
void CutFollower::start_at(const Viewpoint& viewpoint) {
    const Sphere& root = tree_.bounds()[VertexTree::root()].ring;
    const double distance = glm::length(viewpoint.eye - glm::dvec3(root.centre));
    const double least = std::max(static_cast<double>(root.radius) * 1e-3, std::numeric_limits<double>::min());
    // A turn of the gaze counts as twice the eye movement that would turn the view by the same angle: gazes mostly go with
    // the view.
    length_per_radian_ = 2 * std::max(distance, least);
    settler_.front().set_longest_slack(distance + static_cast<double>(root.radius));
    settler_.watch_nothing();
    look_from(viewpoint);
    settler_.front().use(tester_->has_moving_lights(), tester_->has_planes());
    settler_.front().move_to(viewpoint.eye, 0);
}

void CutFollower::move_to(const Viewpoint& viewpoint, const Motion& motion) {
    look_from(viewpoint);
    // With a gaze, directions count, too: coming nearer does not make up for them.
    if (tester_->uses_gaze()) settler_.front().advance(motion.position, motion.facing);
    else settler_.front().move_to(viewpoint.eye, motion.facing);
    // Where lights stand still nothing is due by them, not even what any motion would make due.
    if (motion.light > 0) settler_.front().advance_lights(motion.light);
    settler_.front().advance_planes(motion.planes, tester_->view());
}

void CutFollower::look_from(const Viewpoint& viewpoint) {
    tester_->look_from(viewpoint, length_per_radian_);
    // Nodes are at most this far away, and no farther than twice that when a deadline comes that is set now.
    const Sphere& root = tree_.bounds()[VertexTree::root()].ring;
    const double farthest = glm::length(viewpoint.eye - glm::dvec3(root.centre)) + 2 * static_cast<double>(root.radius);
    settler_.front().set_rounding_margin(static_cast<float>(2 * farthest) * test_rounding);
}

void CutFollower::follow_threshold(CutState& cut, const Viewpoint& viewpoint, const Motion& motion) {
    if (!(motion.position < longest_step * length_per_radian_)) {
        start_at(viewpoint);
        if (time_limit_) start_in_time(cut);
        else start_over(cut);
        return;
    }
    move_to(viewpoint, motion);
    step(cut, motion);
    max_fold_cost_ = settler_.largest_cost_left(threshold_);
}

// ---- budgets

void CutFollower::follow_budget(CutState& cut, const Viewpoint& viewpoint, const Motion& motion) {
    const bool is_exact = options_.hysteresis <= 1 || options_.fill_budget;
    if (is_exact || !(motion.position < longest_step * length_per_radian_)) {
        start_at(viewpoint);
        start_with_budget(cut);
        return;
    }
    const Sphere& root = tree_.bounds()[VertexTree::root()].ring;
    settler_.front().set_longest_slack(glm::length(viewpoint.eye - glm::dvec3(root.centre)) +
                                       static_cast<double>(root.radius));
    move_to(viewpoint, motion);
    cut.begin_changes();
    if (settler_.front().empty()) settler_.watch_all(cut, rules(), CutSettler::Deadlines::now);
    keep_within_budget(cut);
    cut.end_changes(stats_);
}

void CutFollower::start_with_budget(CutState& cut) { cut.change_to(decide_with_budget(), stats_); }

// The best cut within the budget. What to watch for hysteresis is left to the next call.
std::vector<std::uint64_t> CutFollower::decide_with_budget() {
    const VertexTree* const tree = &tree_;
    const CostSource* const source = &*tester_;
    const auto is_out = [this] { return is_out_of_deciding_time(); };
    BudgetLimits limits{*options_.triangle_budget, options_.fill_budget, false, {}};
    if (time_limit_) limits.is_out_of_time = is_out;
    BudgetDecision decision = decide_budget({&tree, 1}, {&source, 1}, limits);
    stats_.node_tests += decision.node_tests;
    stats_.is_complete = decision.is_complete;
    max_fold_cost_ = decision.max_seen_cost;
    is_tracking_ = true;
    settler_.watch_nothing();
    if (keeping_factor() > 1) {
        threshold_ = std::max(decision.threshold, least_threshold);
        tester_->set_threshold(threshold_);
    }
    return std::move(decision.unfolded[0]);
}

// Half of the hysteresis (as a factor: its root) keeps nodes unfolded, and half of the rest keeps the threshold.
float CutFollower::keeping_factor() const {
    return options_.triangle_budget && options_.hysteresis > 1 && !options_.fill_budget ? std::sqrt(options_.hysteresis)
                                                                                        : 1;
}

// Steps at the threshold there is, and moves it where the triangles have become too many, or so few that a better one
// can be expected. Every change of the threshold by `factor` moves all distances by that factor: at most (factor - 1)
// times twice the farthest point's distance for nodes whose slack was cut to that, as an advance of the clock.
void CutFollower::keep_within_budget(CutState& cut) {
    const double budget = *options_.triangle_budget;
    // The number of triangles goes about with the inverse square of the threshold.
    const double enough = budget / std::sqrt(static_cast<double>(options_.hysteresis));
    settle_due(cut);
    constexpr int most_rounds = 24;
    // What hysteresis keeps unfolded folds only when the threshold has grown by that factor: half of the rounds suffice.
    const double least_step = std::max(1.005, std::pow(static_cast<double>(keeping_factor()), 2.0 / most_rounds));
    bool was_above = false;
    for (int round = 0;; ++round) {
        const double triangles = cut.triangle_count();
        const bool is_above = triangles > budget || settler_.has_waiting(); // for what waits in time there is no room
        const bool are_few = triangles < enough && !was_above && threshold_ > least_threshold;
        max_fold_cost_ = settler_.largest_cost_left(threshold_);
        if (!is_above && !are_few) return;
        if (!settler_.is_all_tested() || (round > 0 && is_out_of_time())) {
            stats_.is_complete = false;
            return;
        }
        // Jumps in the number of triangles, or a threshold that nothing leads down from: from scratch.
        if (round == most_rounds || !std::isfinite(threshold_)) break;
        was_above |= is_above;
        change_threshold(
            cut, is_above ? static_cast<float>(std::clamp(std::sqrt(triangles / budget) * 1.002, least_step, 1.1))
                          : 1 / static_cast<float>(
                                    std::clamp(std::sqrt(budget / std::max(triangles, 1.0)) * 0.99, 1.005, 1.1)));
    }
    cut.change_further(decide_with_budget());
}

void CutFollower::change_threshold(CutState& cut, float factor) {
    threshold_ = std::max(threshold_ * factor, least_threshold);
    tester_->set_threshold(threshold_);
    const double share = factor > 1 ? factor - 1 : 1 / factor - 1;
    settler_.front().advance(2 * share * settler_.front().longest_slack(), 0);
    settle_due(cut);
}

// ---- from scratch

// Deadlines are left to the first frame that needs some: after a jump there may be another one.
void CutFollower::start_over(CutState& cut) {
    is_tracking_ = true;
    max_fold_cost_ = threshold_;
    settler_.watch_nothing();
    cut.change_to(decide_all(), stats_);
}

// What unfolds, by decisions alone.
std::vector<std::uint64_t> CutFollower::decide_all() {
    const std::uint64_t before = decider_.decisions;
    auto unfolded = decider_.run(
        tree_, [&](std::span<const NodeId> nodes, std::uint64_t* bits) { tester_->decide(nodes, bits); },
        [](std::span<const NodeId>) {});
    stats_.node_tests += decider_.decisions - before;
    return unfolded;
}

// The worst folds first, as far as the time goes; the next call finds what to watch.
void CutFollower::start_in_time(CutState& cut) {
    const VertexTree* const tree = &tree_;
    const CostSource* const source = &*tester_;
    const auto is_out = [this] { return is_out_of_deciding_time(); };
    BudgetLimits limits;
    limits.only_unfolding = true;
    limits.is_out_of_time = is_out;
    BudgetDecision decision = decide_budget({&tree, 1}, {&source, 1}, limits);
    stats_.node_tests += decision.node_tests;
    stats_.is_complete = decision.is_complete;
    max_fold_cost_ = decision.max_seen_cost;
    cut.change_to(std::move(decision.unfolded[0]), stats_);
    is_tracking_ = true;
    settler_.watch_nothing();
}

bool CutFollower::is_out_of_time() const { return time_limit_ && std::chrono::steady_clock::now() >= *time_limit_; }

bool CutFollower::is_out_of_deciding_time() const {
    return std::chrono::steady_clock::now() - begin_ >= deciding_share * (*time_limit_ - begin_);
}

// ---- from frame to frame

void CutFollower::step(CutState& cut, const Motion& motion) {
    if (settler_.front().empty() && !time_limit_) {
        if (!(motion.position < step_worth_deadlines * length_per_radian_)) return start_over(cut);
        cut.begin_changes();
        settler_.watch_and_settle(cut, rules());
        cut.end_changes(stats_);
        return;
    }
    if (time_limit_) {
        cut.begin_changes();
        if (settler_.front().empty()) settler_.watch_all(cut, rules(), CutSettler::Deadlines::now);
        settle_in_time(cut);
        cut.end_changes(stats_);
        return;
    }
    const auto due = settler_.front().collect_due();
    if (static_cast<double>(due.size()) > most_due * static_cast<double>(settler_.front().size()))
        return start_over(cut);
    cut.begin_changes();
    settler_.settle(cut, rules(), due);
    cut.end_changes(stats_);
}

CutSettler::Rules CutFollower::rules() {
    return {&*tester_,
            threshold_,
            keeping_factor(),
            options_.triangle_budget,
            watches_ancestors_,
            time_limit_,
            longest_run * length_per_radian_};
}

void CutFollower::settle_in_time(CutState& cut) {
    settler_.settle_in_time(cut, rules());
    stats_.is_complete = settler_.is_all_tested() && !settler_.has_waiting();
}

void CutFollower::settle_due(CutState& cut) {
    if (!time_limit_) return settler_.settle(cut, rules(), settler_.front().collect_due());
    settle_in_time(cut);
}

std::uint64_t CutFollower::byte_size() const noexcept { return settler_.byte_size(); }

} // namespace unseen::vdtree
