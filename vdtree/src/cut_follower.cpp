#include "cut_follower.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>

#include <glm/geometric.hpp>

#include "budget.h"
#include "prefetch.h"
#include "unchecked_links.h"
#include "walk_children.h"

namespace unseen::vdtree {

namespace {

// Clocks restart when they have run this many times the distance to the tree, so that deadlines in floats stay fine enough.
constexpr double longest_run = 16;
// With more than this share of the watched nodes due, deciding anew from the root down is cheaper: there are some more tests, at half of
// the price.
constexpr double most_due = 0.6;
// After larger steps from a cut without deadlines, deadlines would not be worth making. In lengths for a radian, like longest_step.
constexpr double step_worth_deadlines = 0.03;
constexpr std::size_t piece_tests = 512; // tests at once while slots are filled: what they read stays in the cache
// Beyond this step a good part of all verdicts would be due anyway. In lengths for a radian: twice the tree's distance.
constexpr double longest_step = 0.125;
constexpr double longest_light_step = 0.5; // radians; likewise
// A budget that holds everything has the threshold 0; this stands for it.
constexpr float least_threshold = 1e-30f;
// What so many changes read is fetched ahead: some two thousand cache lines, of which the second-level cache holds several times as many.
constexpr std::size_t changes_at_once = 64;
constexpr double longest_limit_ms = 1e9; // more is no limit
// Of the time that a fresh start has, so much is for decisions; the rest is for changing the cut to them.
constexpr double deciding_share = 0.6;
// Blocks whose due nodes are tested, with what folds for it, between two looks at the clock: some microseconds.
constexpr std::size_t blocks_at_once = 16;
constexpr std::size_t unfolds_in_time = 16; // likewise

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
    make_tester(criterion);
}

// Also where the values are the same, but another object has them: the one that was tested may be gone.
void CutFollower::make_tester(const DistanceCriterion& criterion) {
    const bool has_budget = options_.triangle_budget.has_value();
    tester_.emplace(tree_, criterion, options_.cull_back_faces, threshold_, !has_budget);
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
    if (criterion.parts().lit) motion = with_lights(motion, viewpoint);
    const bool is_still =
        is_same && motion.position == 0 && motion.facing == 0 && motion.planes == 0 && motion.light == 0;
    are_costs_of_view_ = waiting_.empty() || (are_costs_of_view_ && is_still);
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
    stats_.max_fold_cost = max_fold_cost_;
    return stats_;
}

Motion CutFollower::with_lights(Motion motion, const Viewpoint& viewpoint) const {
    const double turn = light_motion(tree_, viewpoint_.lighting, viewpoint_.eye, viewpoint.lighting, viewpoint.eye);
    motion.light = light_weight * length_per_radian_ * turn;
    if (!(turn < longest_light_step)) motion.position = std::numeric_limits<double>::infinity();
    return motion;
}

// For a fresh start: nothing watched, and a length for turns of the gaze.
void CutFollower::start_at(const Viewpoint& viewpoint) {
    const Sphere& root = tree_.bounds()[VertexTree::root()].ring;
    const double distance = glm::length(viewpoint.eye - glm::dvec3(root.centre));
    const double least = std::max(static_cast<double>(root.radius) * 1e-3, std::numeric_limits<double>::min());
    // Of a turn of the gaze as much is made as of twice the shift that the same turn would take: gazes mostly go with the view.
    length_per_radian_ = 2 * std::max(distance, least);
    set_farthest(distance + static_cast<double>(root.radius));
    watch_nothing();
    look_from(viewpoint);
    watched_.use(tester_->has_lights(), tester_->has_planes());
    watched_.move_to(viewpoint.eye, 0);
}

void CutFollower::move_to(const Viewpoint& viewpoint, const Motion& motion) {
    look_from(viewpoint);
    // With a gaze, directions count, too: coming nearer does not make up for them.
    if (tester_->uses_gaze()) watched_.advance(motion.position, motion.facing);
    else watched_.move_to(viewpoint.eye, motion.facing);
    watched_.advance_lights(motion.light);
    watched_.advance_planes(motion.planes, tester_->view(), hair_);
}

void CutFollower::look_from(const Viewpoint& viewpoint) {
    tester_->look_from(viewpoint, length_per_radian_);
    // Nodes are at most this far away, and no farther than twice that when a deadline comes that is set now.
    const Sphere& root = tree_.bounds()[VertexTree::root()].ring;
    const double farthest = glm::length(viewpoint.eye - glm::dvec3(root.centre)) + 2 * static_cast<double>(root.radius);
    hair_ = static_cast<float>(2 * farthest) * test_rounding;
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
    max_fold_cost_ = largest_cost_left();
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
    set_farthest(glm::length(viewpoint.eye - glm::dvec3(root.centre)) + static_cast<double>(root.radius));
    move_to(viewpoint, motion);
    cut.begin_changes();
    if (watched_.empty()) watch_all(cut, Deadlines::now);
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
    watch_nothing();
    if (keeping_factor() > 1) {
        threshold_ = std::max(decision.threshold, least_threshold);
        tester_->set_threshold(threshold_);
    }
    return std::move(decision.unfolded[0]);
}

// Of the hysteresis, half (as a factor: its root) keeps nodes unfolded, and half of the rest keeps the threshold.
float CutFollower::keeping_factor() const {
    return options_.triangle_budget && options_.hysteresis > 1 && !options_.fill_budget ? std::sqrt(options_.hysteresis) : 1;
}

// Steps at the threshold there is, and moves it where the triangles have become too many, or so few that a better one
// can be expected. Every change of the threshold by `factor` moves all distances by that factor: at most
// (factor - 1) times twice the farthest point's distance for nodes whose slack was cut to that, as an advance of the clock.
void CutFollower::keep_within_budget(CutState& cut) {
    const double budget = *options_.triangle_budget;
    // The number of triangles goes about with the inverse square of the threshold.
    const double enough = budget / std::sqrt(static_cast<double>(options_.hysteresis));
    settle_due(cut);
    constexpr int most_rounds = 24;
    bool was_above = false;
    for (int round = 0;; ++round) {
        const double triangles = cut.triangle_count();
        const bool is_above = triangles > budget || !waiting_.empty(); // for what waits in time there is no room
        const bool are_few = triangles < enough && !was_above && threshold_ > least_threshold;
        max_fold_cost_ = largest_cost_left();
        if (!is_above && !are_few) return;
        if (!is_all_tested_ || (round > 0 && is_out_of_time())) {
            stats_.is_complete = false;
            return;
        }
        // Jumps in the number of triangles, or a threshold that nothing leads down from: from scratch.
        if (round == most_rounds || !std::isfinite(threshold_)) break;
        was_above |= is_above;
        change_threshold(cut, is_above ? static_cast<float>(std::clamp(std::sqrt(triangles / budget) * 1.002, 1.005, 1.1))
                                       : 1 / static_cast<float>(std::clamp(std::sqrt(budget / std::max(triangles, 1.0)) * 0.99, 1.005, 1.1)));
    }
    cut.change_further(decide_with_budget());
}

void CutFollower::change_threshold(CutState& cut, float factor) {
    threshold_ = std::max(threshold_ * factor, least_threshold);
    tester_->set_threshold(threshold_);
    const double share = factor > 1 ? factor - 1 : 1 / factor - 1;
    watched_.advance(2 * share * farthest_, 0);
    settle_due(cut);
}

// ---- from scratch

// Deadlines are left to the first frame that needs some: after a jump there may be another one.
void CutFollower::start_over(CutState& cut) {
    is_tracking_ = true;
    max_fold_cost_ = threshold_;
    watch_nothing();
    cut.change_to(decide_all(), stats_);
}

// What unfolds, by decisions alone.
std::vector<std::uint64_t> CutFollower::decide_all() {
    const std::uint64_t before = decider_.decisions;
    auto unfolded = decider_.run(tree_, [&](std::span<const NodeId> nodes, std::uint64_t* bits) { tester_->decide(nodes, bits); },
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
    watch_nothing();
}

void CutFollower::watch_nothing() {
    watched_.clear();
    waiting_.clear();
    are_costs_of_view_ = is_all_tested_ = true;
    next_due_ = 0;
}

// What can change next, from a cut of which nothing is watched: all due, or tested, with what folds and unfolds for it.
void CutFollower::watch_all(const CutState& cut, Deadlines deadlines) {
    watch_nothing();
    find_border(cut);
    watched_.reserve(next_wave_.size());
    for (std::size_t first = 0; first < next_wave_.size(); first += piece_tests) {
        const auto piece = std::span(next_wave_).subspan(first, std::min(piece_tests, next_wave_.size() - first));
        wave_slots_.clear();
        for (std::size_t i = 0; i < piece.size(); ++i) {
            constexpr std::size_t ahead = 16; // nodes between a prefetch and its use
            if (i + ahead < piece.size()) tester_->prefetch(piece[i + ahead]);
            FoldCandidate candidate = tester_->candidate(piece[i]);
            candidate.is_unfolded = cut.is_unfolded_interior(piece[i]);
            wave_slots_.push_back(watched_.append(candidate));
        }
        watched_.end_append();
        if (deadlines == Deadlines::found) test_slots(wave_slots_);
        else for (const Slot slot : wave_slots_) set_deadlines(slot, Verdict{});
    }
}

// The nodes to watch, in about their order, as the next wave.
void CutFollower::find_border(const CutState& cut) {
    unfolding_.clear();
    for (std::size_t word = 0; word < cut.unfolded().size(); ++word)
        for (std::uint64_t bits = cut.unfolded()[word]; bits; bits &= bits - 1)
            unfolding_.push_back(static_cast<NodeId>(word * 64 + static_cast<std::size_t>(std::countr_zero(bits))));
    next_wave_.clear();
    if (unfolding_.empty()) next_wave_.push_back(VertexTree::root());
    std::size_t at = 0;
    bool is_border = true;
    const auto go_to = [&](std::size_t next) {
        for (; at < next; ++at, is_border = true)
            if (is_border || watches_ancestors_) next_wave_.push_back(unfolding_[at]);
    };
    walk_children(tree_, unfolding_.size(), [&](std::size_t i) { return unfolding_[i]; }, [&](std::size_t i, NodeId child) {
        go_to(i);
        if (cut.is_unfolded_interior(child)) is_border = false;
        else next_wave_.push_back(child);
    });
    go_to(unfolding_.size());
}

bool CutFollower::is_out_of_time() const { return time_limit_ && std::chrono::steady_clock::now() >= *time_limit_; }

bool CutFollower::is_out_of_deciding_time() const {
    return std::chrono::steady_clock::now() - begin_ >= deciding_share * (*time_limit_ - begin_);
}

// ---- from frame to frame

void CutFollower::step(CutState& cut, const Motion& motion) {
    if (watched_.empty() && !time_limit_) {
        if (!(motion.position < step_worth_deadlines * length_per_radian_)) return start_over(cut);
        cut.begin_changes();
        begin_settling();
        watch_all(cut, Deadlines::found);
        end_settling(cut);
        cut.end_changes(stats_);
        return;
    }
    if (time_limit_) {
        cut.begin_changes();
        if (watched_.empty()) watch_all(cut, Deadlines::now);
        settle_in_time(cut);
        cut.end_changes(stats_);
        return;
    }
    const auto due = watched_.collect_due();
    if (static_cast<double>(due.size()) > most_due * static_cast<double>(watched_.size())) return start_over(cut);
    cut.begin_changes();
    settle(cut, due);
    cut.end_changes(stats_);
}

void CutFollower::settle_due(CutState& cut) {
    if (time_limit_) settle_in_time(cut);
    else settle(cut, watched_.collect_due());
}

// Tests what is due, folds what has to go, and unfolds what has to come, with all that follows above and under it.
void CutFollower::settle(CutState& cut, std::span<const Slot> due) {
    begin_settling();
    constexpr std::size_t piece = 2048; // what their tests read and write stays in the cache
    for (std::size_t first = 0; first < due.size(); first += piece) test_due(due.subspan(first, std::min(piece, due.size() - first)));
    end_settling(cut);
}

// The same in small steps, as many as the time is enough for: at least one of tests and folds, and one of unfolds. Both get the same time,
// for what is not tested keeps what is unfolded from being right, and unfolds alone make the cut better. What is left to do is kept.
void CutFollower::settle_in_time(CutState& cut) {
    using Clock = std::chrono::steady_clock;
    begin_settling();
    if (waiting_.size() > watched_.size()) drop_idle();
    watched_.find_due_blocks(next_due_);
    std::size_t looked_at = 0; // blocks; splitting some adds to them
    Clock::duration testing{}, unfolding{};
    Clock::time_point now = Clock::now();
    for (int steps = 0;; ++steps) {
        const auto left = watched_.due_blocks().subspan(looked_at);
        const bool can_unfold = find_worst(cut);
        if (left.empty() && !can_unfold) break;
        constexpr int least_steps = 2;
        if (steps >= least_steps && now >= *time_limit_) break;
        const bool tests = !left.empty() && (!can_unfold || testing <= unfolding);
        if (tests) {
            const std::size_t count = std::min(left.size(), blocks_at_once);
            test_due(watched_.collect_due(left.first(count)));
            looked_at += count;
            finish_folding(cut);
            let_wave_wait();
        } else {
            unfold_worst(cut);
        }
        const Clock::time_point after = Clock::now();
        (tests ? testing : unfolding) += after - now;
        now = after;
    }
    const auto left = watched_.due_blocks().subspan(looked_at);
    is_all_tested_ = left.empty();
    next_due_ = left.empty() ? 0 : left.front();
    stats_.is_complete = is_all_tested_ && waiting_.empty();
    watched_.restart_clocks(longest_run * length_per_radian_);
}

void CutFollower::begin_settling() {
    folding_.clear();
    parents_.clear();
    wave_.clear();
}

void CutFollower::finish_folding(CutState& cut) {
    while (!folding_.empty() || !parents_.empty()) {
        fold_wave(cut);
        test_parents(cut);
    }
}

void CutFollower::end_settling(CutState& cut) {
    finish_folding(cut);
    for (const Waiting& waiting : waiting_) { // of calls with a time limit
        if (!waits(waiting.node)) continue;
        watched_.set_waiting(watched_.slot_of(waiting.node), false);
        wave_.push_back(waiting.node);
    }
    waiting_.clear();
    is_all_tested_ = true;
    unfold_wave(cut);
    watched_.restart_clocks(longest_run * length_per_radian_);
}

void CutFollower::test_due(std::span<const Slot> slots) {
    if (keeping_factor() == 1) {
        test_slots(slots);
        return;
    }
    for (const bool unfolded : {true, false}) {
        kept_.clear();
        for (const Slot slot : slots)
            if (watched_[slot].is_unfolded == unfolded) kept_.push_back(slot);
        use_threshold_of(unfolded);
        test_slots(kept_);
    }
}

void CutFollower::test_slots(std::span<const Slot> slots) {
    stats_.node_tests += slots.size();
    TestBatch tested{};
    for (std::size_t first = 0; first < slots.size(); first += kernel_lanes) {
        const auto batch = slots.subspan(first, std::min(kernel_lanes, slots.size() - first));
        tester_->test(watched_.candidates(), slots, first, tested);
        watched_.set_deadlines(batch, tested, {longest_slack_, hair_});
        for (std::size_t i = 0; i < batch.size(); ++i) {
            const FoldCandidate& candidate = watched_[batch[i]];
            const bool unfolds = (tested.unfolded >> i) & 1;
            // Mostly all stays as it is. What was folded or unfolded before, nobody could foretell, so nothing branches on that.
            if (!(candidate.is_waiting | (candidate.is_unfolded != unfolds) | (unfolds & stands_by_a_hair(tested, i)))) continue;
            if (candidate.is_waiting) {
                if (!unfolds) watched_.set_waiting(batch[i], false);
            } else if (candidate.is_unfolded && !unfolds) folding_.push_back(candidate.node);
            else if (candidate.is_unfolded && stands_by_a_hair(tested, i)) ask_parent(candidate.node);
            else if (unfolds && !candidate.is_unfolded && tree_.is_sound(candidate.node)) wave_.push_back(candidate.node);
        }
    }
}

// What the follower itself will read and write, too.
void CutFollower::prefetch_changes(CutState& cut, std::span<const NodeId> nodes, bool folds) {
    for (const NodeId node : nodes) {
        watched_.prefetch_slot(node);
        prefetch(&unchecked_links(tree_).parents[node]);
    }
    cut.prefetch_changes(nodes, folds);
    for (const NodeId node : nodes) {
        watched_.prefetch_deadlines(node);
        if (const NodeId parent = unchecked_links(tree_).parents[node]; parent != no_node)
            watched_.prefetch_slot(parent);
    }
    for (const NodeId child : cut.fetched_children()) {
        if (tree_.is_leaf(child)) continue;
        watched_.prefetch_slot(child);
        if (!folds) tester_->prefetch(child);
    }
    if (folds) {
        for (const NodeId child : cut.fetched_children())
            if (!tree_.is_leaf(child)) watched_.prefetch_deadlines(child);
    } else {
        for (const NodeId node : nodes)
            if (const NodeId parent = unchecked_links(tree_).parents[node]; parent != no_node)
                watched_.prefetch_deadlines(parent);
    }
}

// Folds with all that is under it what the last tests want folded, the lowest nodes first; what is above may want to fold now.
void CutFollower::fold_wave(CutState& cut) {
    std::sort(folding_.begin(), folding_.end(), std::greater<>());
    const auto subtree_end = unchecked_links(tree_).subtree_end;
    for (std::size_t i = 0; i < folding_.size(); ++i) {
        if (i % changes_at_once == 0) prefetch_changes(cut, std::span(folding_).subspan(i, std::min(changes_at_once, folding_.size() - i)), true);
        const NodeId node = folding_[i];
        if (!cut.is_unfolded_interior(node)) continue;
        const auto children = cut.fetched_children(i % changes_at_once);
        const auto has_fold = [&](NodeId child) { return !tree_.is_leaf(child) && cut.is_unfolded_interior(child); };
        if (std::ranges::none_of(children, has_fold)) { // nearly always
            cut.apply_fold(node, children);
            for (const NodeId child : children)
                if (!tree_.is_leaf(child)) watched_.remove(child);
        } else {
            cut.fold_below(node, [&](NodeId folded) {
                for (NodeId child = folded + 1; child < subtree_end[folded]; child = subtree_end[child]) watched_.remove(child);
            });
        }
        watched_.set_unfolded(watched_.slot_of(node), false);
        ask_parent(node);
    }
    folding_.clear();
}

void CutFollower::ask_parent(NodeId node) {
    if (node != VertexTree::root() && !watches_ancestors_) parents_.push_back(unchecked_links(tree_).parents[node]);
}

// Nodes that are watched are left to their deadlines.
void CutFollower::test_parents(const CutState& cut) {
    std::sort(parents_.begin(), parents_.end());
    parents_.erase(std::unique(parents_.begin(), parents_.end()), parents_.end());
    std::erase_if(parents_, [&](NodeId node) { return !cut.is_unfolded_interior(node) || watched_.slot_of(node) != no_slot; });
    parent_candidates_.clear();
    for (const NodeId node : parents_) {
        tester_->prefetch(node);
        prefetch(&unchecked_links(tree_).subtree_end[node]);
    }
    for (const NodeId node : parents_) {
        parent_candidates_.push_back(tester_->candidate(node));
        parent_candidates_.back().is_unfolded = true;
    }
    parents_.clear();
    if (parent_candidates_.empty()) return;
    use_threshold_of(true);
    verdicts_.resize(parent_candidates_.size());
    tester_->test(parent_candidates_, verdicts_);
    stats_.node_tests += parent_candidates_.size();
    for (std::size_t i = 0; i < parent_candidates_.size(); ++i) {
        const NodeId node = parent_candidates_[i].node;
        if (!verdicts_[i].unfolded || !has_unfolded_child(node, cut.unfolded()))
            set_deadlines(watched_.insert(parent_candidates_[i], near_children_of(node)), verdicts_[i]);
        if (!verdicts_[i].unfolded) folding_.push_back(node);
        else if (stands_by_a_hair(verdicts_[i])) ask_parent(node);
    }
    use_threshold_of(false);
}

// With hysteresis, what is unfolded stays so down to a somewhat lower cost.
void CutFollower::use_threshold_of(bool unfolded) {
    const float keeping = keeping_factor();
    if (keeping > 1) tester_->set_threshold(unfolded ? threshold_ / keeping : threshold_);
}

// Watches the children of what has unfolded, too: they are the next wave.
void CutFollower::apply_unfold(CutState& cut, NodeId node, std::span<const NodeId> children) {
    cut.apply_unfold(node, children);
    watched_.set_unfolded(watched_.slot_of(node), true);
    if (node != VertexTree::root() && !watches_ancestors_) watched_.remove(unchecked_links(tree_).parents[node]);
    for (const NodeId child : children) {
        if (tree_.is_leaf(child)) continue;
        watched_.insert(tester_->candidate(child), watched_.slot_of(node));
        next_wave_.push_back(child);
    }
}

// Those of the next wave that unfold make the one after it.
void CutFollower::test_next_wave() {
    wave_slots_.clear();
    for (const NodeId node : next_wave_) wave_slots_.push_back(watched_.slot_of(node)); // inserting may have moved them
    next_wave_.clear();
    test_slots(wave_slots_);
}

// What unfolds, and then what unfolds under it.
void CutFollower::unfold_wave(CutState& cut) {
    std::sort(wave_.begin(), wave_.end());
    next_wave_.clear();
    while (!wave_.empty()) {
        for (std::size_t i = 0; i < wave_.size(); ++i) {
            const NodeId node = wave_[i];
            if (i % changes_at_once == 0) prefetch_changes(cut, std::span(wave_).subspan(i, std::min(changes_at_once, wave_.size() - i)), false);
            if (watched_.slot_of(node) == no_slot) continue; // an ancestor has folded
            apply_unfold(cut, node, cut.fetched_children(i % changes_at_once));
        }
        wave_.clear();
        test_next_wave();
    }
}

// ---- in time

bool CutFollower::waits(NodeId node) const {
    const Slot slot = watched_.slot_of(node);
    return slot != no_slot && watched_[slot].is_waiting;
}

// The wave waits for its turn, the worst first.
void CutFollower::let_wave_wait() {
    std::erase_if(wave_, [&](NodeId node) { return watched_.slot_of(node) == no_slot; }); // an ancestor has folded
    costs_.resize(wave_.size());
    seen_costs_.resize(wave_.size());
    unfolds_.resize((wave_.size() + 63) / 64);
    if (waiting_.empty()) are_costs_of_view_ = true;
    if (!wave_.empty()) tester_->find_costs(wave_, {costs_.data(), seen_costs_.data(), unfolds_.data()});
    for (std::size_t i = 0; i < wave_.size(); ++i) {
        watched_.set_waiting(watched_.slot_of(wave_[i]), true);
        const float cost = seen_costs_[i] >= 0 ? seen_costs_[i] : std::numeric_limits<float>::infinity();
        waiting_.push_back({cost, wave_[i]});
        std::push_heap(waiting_.begin(), waiting_.end());
    }
    wave_.clear();
}

NodeId CutFollower::pop_waiting() {
    std::pop_heap(waiting_.begin(), waiting_.end());
    const NodeId node = waiting_.back().node;
    waiting_.pop_back();
    return node;
}

// Brings what waits to the top; false where there is none, or no room for it in a budget.
bool CutFollower::find_worst(const CutState& cut, Index more) {
    while (!waiting_.empty() && !waits(waiting_.front().node)) pop_waiting();
    if (waiting_.empty()) return false;
    const auto first = unchecked_links(tree_).first_triangle;
    const NodeId node = waiting_.front().node;
    return !options_.triangle_budget || std::uint64_t{cut.triangle_count()} + more + (first[node + 1] - first[node]) <= *options_.triangle_budget;
}

void CutFollower::unfold_worst(CutState& cut) {
    Index triangles = 0;
    while (wave_.size() < unfolds_in_time && find_worst(cut, triangles)) {
        const NodeId node = pop_waiting();
        watched_.set_waiting(watched_.slot_of(node), false);
        triangles += unchecked_links(tree_).first_triangle[node + 1] - unchecked_links(tree_).first_triangle[node];
        wave_.push_back(node);
    }
    prefetch_changes(cut, wave_, false);
    next_wave_.clear();
    for (std::size_t i = 0; i < wave_.size(); ++i) apply_unfold(cut, wave_[i], cut.fetched_children(i));
    wave_.clear();
    test_next_wave();
    let_wave_wait();
}

// Forgets what does not wait any more.
void CutFollower::drop_idle() {
    std::erase_if(waiting_, [&](const Waiting& waiting) { return !waits(waiting.node); });
    std::make_heap(waiting_.begin(), waiting_.end());
}

// No more than this costs any node that is folded, if the view is that of the last tests.
float CutFollower::largest_cost_left() const {
    if (!is_all_tested_ || !are_costs_of_view_) return std::numeric_limits<float>::infinity();
    return waiting_.empty() ? threshold_ : std::max(threshold_, waiting_.front().cost);
}

// ---- slots

bool CutFollower::has_unfolded_child(NodeId node, std::span<const std::uint64_t> unfolded) const {
    const auto subtree_end = unchecked_links(tree_).subtree_end;
    for (NodeId child = node + 1; child < subtree_end[node]; child = subtree_end[child])
        if ((unfolded[child >> 6] >> (child & 63)) & 1) return true;
    return false;
}

// A node's children are its neighbours.
CutFollower::Slot CutFollower::near_children_of(NodeId node) const {
    const auto subtree_end = unchecked_links(tree_).subtree_end;
    for (NodeId child = node + 1; child < subtree_end[node]; child = subtree_end[child])
        if (const Slot slot = watched_.slot_of(child); slot != no_slot) return slot;
    return no_slot;
}

// Unfolded nodes speak for their ancestors, too, whose tests round in their own way.
void CutFollower::set_deadlines(Slot slot, const Verdict& verdict) {
    const float hair = verdict.unfolded ? hair_ : 0;
    const float position_slack = std::min(verdict.position_slack, longest_slack_);
    const auto less_hair = [&](float slack) { return std::max(slack - hair, 0.0f); };
    watched_.set_deadlines(slot, {verdict.unfolded, less_hair(position_slack), less_hair(verdict.facing_slack),
                                  less_hair(verdict.plane_slack), less_hair(verdict.light_slack)});
}

std::uint64_t CutFollower::byte_size() const noexcept { return watched_.byte_size() + sizeof(Waiting) * waiting_.capacity(); }

} // namespace unseen::vdtree
