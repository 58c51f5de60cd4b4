// Keeps a cut at what a distance criterion asks for while the viewpoint moves: what a frame does.
#pragma once

#include <unseen/vdtree/internal/light_bounds.h>

#include "cut/budget.h"
#include "cut/cut_settler.h"
#include "cut/decide_tree.h"

namespace unseen::vdtree {

// A view that stands still costs nothing. After a small step the clocks go on, and what is due is settled (CutSettler);
// within a budget, with the threshold moved until the triangles fit. After a jump, or under another criterion, the cut
// is decided anew from the root; what to watch from there on is left to the first frame that needs it, for there may be
// another jump.
class CutFollower {
public:
    explicit CutFollower(const VertexTree& tree) : tree_(tree), settler_(tree) {}

    // Brings the cut to what the criterion and the options ask for.
    AdjustStats follow(CutState& cut, const DistanceCriterion& criterion, const Viewpoint& viewpoint,
                       const FollowOptions& options) {
        stats_ = {};
        time_limit_.reset();
        if (options.milliseconds && *options.milliseconds < longest_limit_ms) {
            begin_ = std::chrono::steady_clock::now();
            time_limit_ = begin_ + std::chrono::nanoseconds(static_cast<std::int64_t>(*options.milliseconds * 1e6));
        }
        const bool is_same = is_same_request(criterion, options);
        if (!is_same) prepare(criterion, options);
        Motion motion = is_same ? FoldTester::motion(tree_, viewpoint_, viewpoint, length_per_radian_)
                                : Motion{.position = infinity};
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
        if (is_still && !stats_.is_complete)
            max_fold_cost_ = std::min(max_fold_cost_, std::max(cost_before, threshold_));
        stats_.node_tests += settler_.take_node_tests();
        stats_.max_fold_cost = max_fold_cost_;
        return stats_;
    }
    // The cut was changed by others.
    void forget() noexcept { is_tracking_ = false; }
    std::uint64_t byte_size() const noexcept { return settler_.byte_size(); }

private:
    // Clocks restart when they have run this many times the distance to the tree, so that deadlines in floats stay fine
    // enough.
    static constexpr double longest_run = 16;
    // With more than this share of the watched nodes due, deciding anew from the root down is cheaper: there are some more
    // tests, at half of the price.
    static constexpr double most_due = 0.6;
    // After larger steps from a cut without deadlines, deadlines would not be worth making. In lengths for a radian, like
    // longest_step.
    static constexpr double step_worth_deadlines = 0.03;
    // Beyond this step a good part of all verdicts would be due anyway. In lengths for a radian: twice the tree's distance.
    static constexpr double longest_step = 0.125;
    static constexpr double longest_light_step = 0.5; // radians; likewise
    // A budget that holds everything has the threshold 0; this stands for it.
    static constexpr float least_threshold = 1e-30f;
    static constexpr double longest_limit_ms = 1e9; // more is no limit
    // Share of a fresh start's time for decisions; the rest is for changing the cut.
    static constexpr double deciding_share = 0.6;

    static constexpr double infinity = std::numeric_limits<double>::infinity();

    // ---- the request, and what is made of it

    bool is_same_request(const DistanceCriterion& criterion, const FollowOptions& options) const {
        return is_tracking_ && criterion.is_copy_of(tester_->criterion()) &&
               options.cull_back_faces == options_.cull_back_faces && options.threshold == options_.threshold &&
               options.triangle_budget == options_.triangle_budget && options.fill_budget == options_.fill_budget &&
               options.hysteresis == options_.hysteresis;
    }

    void prepare(const DistanceCriterion& criterion, const FollowOptions& options) {
        options_ = options;
        threshold_ = options.threshold;
        is_tracking_ = false;
        tester_.emplace(tree_, criterion, options.cull_back_faces, threshold_, !options.triangle_budget);
        tester_->let_lights_move(false); // until they do
    }

    CutSettler::Rules rules() {
        return {&*tester_,
                threshold_,
                keeping_factor(),
                options_.triangle_budget,
                !tester_->is_monotone(),
                time_limit_,
                longest_run * length_per_radian_};
    }

    // Half of the hysteresis (as a factor: its root) keeps nodes unfolded, and half of the rest keeps the threshold.
    float keeping_factor() const {
        return options_.triangle_budget && options_.hysteresis > 1 && !options_.fill_budget
                   ? std::sqrt(options_.hysteresis)
                   : 1;
    }

    // ---- where the eye is

    double root_radius() const { return tree_.bounds()[VertexTree::root()].ring.radius; }
    double distance_to_root(const Viewpoint& viewpoint) const {
        return glm::length(viewpoint.eye - glm::dvec3(tree_.bounds()[VertexTree::root()].ring.centre));
    }
    // Lights that begin to move are a jump, like others: up to then verdicts held for where they were.
    Motion with_lights(Motion motion, const Viewpoint& viewpoint, bool is_same) {
        const double turn = light_motion(tree_, viewpoint_.lighting, viewpoint_.eye, viewpoint.lighting, viewpoint.eye);
        motion.light = light_weight * length_per_radian_ * turn;
        const bool begins = turn > 0 && !tester_->has_moving_lights();
        if (!(turn < longest_light_step) || begins) motion.position = infinity;
        if (is_same && turn > 0) tester_->let_lights_move(true);
        return motion;
    }

    // For a fresh start: nothing watched, and a length for turns of the gaze.
    void start_at(const Viewpoint& viewpoint) {
        const double least = std::max(1e-3 * root_radius(), std::numeric_limits<double>::min());
        // A turn of the gaze counts as twice the eye movement that would turn the view by the same angle: gazes mostly go with
        // the view.
        length_per_radian_ = 2 * std::max(distance_to_root(viewpoint), least);
        settler_.front().set_longest_slack(distance_to_root(viewpoint) + root_radius());
        settler_.watch_nothing();
        look_from(viewpoint);
        settler_.front().use(tester_->uses_gaze(), tester_->has_moving_lights(), tester_->has_planes());
        settler_.front().move_to(viewpoint.eye, 0);
        if (tester_->uses_gaze()) settler_.front().look(*viewpoint.gaze);
    }

    void move_to(const Viewpoint& viewpoint, const Motion& motion) {
        look_from(viewpoint);
        settler_.front().move_to(viewpoint.eye, motion.facing);
        // While it stands still nothing is due by it, not even what any motion would make due.
        if (tester_->uses_gaze() && motion.position > 0)
            settler_.front().turn_gaze(gaze_motion(tree_, viewpoint_, viewpoint));
        // Where lights stand still nothing is due by them, not even what any motion would make due.
        if (motion.light > 0) settler_.front().advance_lights(motion.light);
        settler_.front().advance_planes(motion.planes, tester_->view());
    }

    void look_from(const Viewpoint& viewpoint) {
        tester_->look_from(viewpoint, length_per_radian_);
        // Nodes are at most this far away, and no farther than twice that when a deadline comes that is set now.
        const double farthest = distance_to_root(viewpoint) + 2 * root_radius();
        settler_.front().set_rounding_margin(static_cast<float>(2 * farthest) * test_rounding);
    }

    // ---- by a threshold

    void follow_threshold(CutState& cut, const Viewpoint& viewpoint, const Motion& motion) {
        if (!(motion.position < longest_step * length_per_radian_)) {
            start_at(viewpoint);
            if (time_limit_) cut.change_to(decide_by_costs(), stats_);
            else start_over(cut);
            return;
        }
        move_to(viewpoint, motion);
        step(cut, motion);
        max_fold_cost_ = settler_.largest_cost_left(threshold_);
    }

    void step(CutState& cut, const Motion& motion) {
        const CutFront& front = settler_.front();
        if (time_limit_) {
            cut.begin_changes();
            if (front.empty()) settler_.watch_all(cut, rules());
            settle_due(cut);
        } else if (front.empty()) {
            if (!(motion.position < step_worth_deadlines * length_per_radian_)) return start_over(cut);
            cut.begin_changes();
            settler_.watch_and_settle(cut, rules());
        } else {
            const auto due = settler_.front().collect_due();
            if (static_cast<double>(due.size()) > most_due * static_cast<double>(front.size())) return start_over(cut);
            cut.begin_changes();
            settler_.settle(cut, rules(), due);
        }
        cut.end_changes(stats_);
    }

    void settle_due(CutState& cut) {
        if (time_limit_) {
            settler_.settle_in_time(cut, rules());
            stats_.is_complete = settler_.is_all_tested() && !settler_.has_waiting();
        } else {
            settler_.settle(cut, rules(), settler_.front().collect_due());
        }
        cut.settle_needs();
    }

    // Deadlines are left to the first frame that needs some: after a jump there may be another one.
    void start_over(CutState& cut) {
        is_tracking_ = true;
        max_fold_cost_ = threshold_;
        settler_.watch_nothing();
        const std::uint64_t before = decider_.decisions;
        auto unfolded = decider_.run(
            tree_, [&](std::span<const NodeId> nodes, std::uint64_t* bits) { tester_->decide(nodes, bits); },
            [](std::span<const NodeId>) {});
        stats_.node_tests += decider_.decisions - before;
        cut.change_to(std::move(unfolded), stats_);
    }

    // The best cut within the budget; or what unfolds at the threshold, the worst folds first, as far as the time goes. What
    // to watch is left to the next call.
    std::vector<std::uint64_t> decide_by_costs() {
        BudgetLimits limits;
        limits.only_unfolding = !options_.triangle_budget;
        if (options_.triangle_budget) limits.triangles = *options_.triangle_budget;
        limits.fill = options_.triangle_budget && options_.fill_budget;
        if (time_limit_)
            limits.is_out_of_time = [this] {
                return std::chrono::steady_clock::now() - begin_ >= deciding_share * (*time_limit_ - begin_);
            };
        const CostSource* const source = &*tester_;
        BudgetDecision decision = decide_budget({&source, 1}, limits);
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

    // ---- by a budget

    void follow_budget(CutState& cut, const Viewpoint& viewpoint, const Motion& motion) {
        const bool is_exact = options_.hysteresis <= 1 || options_.fill_budget;
        if (is_exact || !(motion.position < longest_step * length_per_radian_)) {
            start_at(viewpoint);
            cut.change_to(decide_by_costs(), stats_);
            return;
        }
        settler_.front().set_longest_slack(distance_to_root(viewpoint) + root_radius());
        move_to(viewpoint, motion);
        cut.begin_changes();
        if (settler_.front().empty()) settler_.watch_all(cut, rules());
        keep_within_budget(cut);
        cut.end_changes(stats_);
    }

    // Steps at the threshold there is, and moves it where the triangles have become too many, or so few that a better one
    // can be expected. Every change of the threshold by `factor` moves all distances by that factor: at most (factor - 1)
    // times twice the farthest point's distance for nodes whose slack was cut to that, as an advance of the clock.
    void keep_within_budget(CutState& cut) {
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
            const bool is_above =
                triangles > budget || settler_.has_waiting(); // for what waits in time there is no room
            const bool are_few = triangles < enough && !was_above && threshold_ > least_threshold;
            max_fold_cost_ = settler_.largest_cost_left(threshold_);
            if (!is_above && !are_few) return;
            if (!settler_.is_all_tested() ||
                (round > 0 && time_limit_ && std::chrono::steady_clock::now() >= *time_limit_)) {
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
        cut.change_further(decide_by_costs());
    }

    void change_threshold(CutState& cut, float factor) {
        threshold_ = std::max(threshold_ * factor, least_threshold);
        tester_->set_threshold(threshold_);
        const double share = factor > 1 ? factor - 1 : 1 / factor - 1;
        settler_.front().advance(2 * share * settler_.front().longest_slack());
        settle_due(cut);
    }

    const VertexTree& tree_;
    CutSettler settler_;
    // The request.
    FollowOptions options_;
    std::optional<FoldTester> tester_; // of its criterion
    float threshold_ = 1;              // with hysteresis it follows the budget
    // The last call.
    bool is_tracking_ = false;
    bool was_complete_ = true;
    float max_fold_cost_ = 0;
    Viewpoint viewpoint_;
    double length_per_radian_ = 1; // what turns of the gaze count as on the position clock
    // This call.
    std::chrono::steady_clock::time_point begin_;
    std::optional<std::chrono::steady_clock::time_point> time_limit_;
    AdjustStats stats_;
    TreeDecider decider_; // scratch
};

} // namespace unseen::vdtree
