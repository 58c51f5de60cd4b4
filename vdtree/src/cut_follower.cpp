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

namespace unseen::vdtree {

namespace {

constexpr std::int32_t never = std::numeric_limits<std::int32_t>::max();

// Clocks restart when they have run this many times the distance to the tree, so that deadlines in floats stay fine enough.
constexpr double longest_run = 16;
// With more than this share of the watched nodes due, testing all of them from the root down is cheaper.
// (A test from the root down costs about twice one in place, and there are more of them.)
constexpr double most_due = 0.75;
// Beyond this step a good part of all verdicts would be due anyway. In lengths for a radian: twice the tree's distance.
constexpr double longest_step = 0.125;
constexpr double longest_light_step = 0.5; // radians; likewise
// A budget that holds everything has the threshold 0; this stands for it.
constexpr float least_threshold = 1e-30f;
// What so many changes read is fetched ahead: some hundred cache lines, of which the first-level cache holds several times as many.
constexpr std::size_t changes_at_once = 16;
constexpr double longest_limit_ms = 1e9; // more is no limit

// Four deadlines in a register of any processor.
using Four [[gnu::vector_size(16)]] = std::int32_t;

Four load(const std::int32_t* from) {
    Four four;
    std::memcpy(&four, from, sizeof four);
    return four;
}

// A bit for each of up to `most` entries in which either deadline has come.
template <std::size_t most>
std::uint64_t due_bits(const std::int32_t* position_due, const std::int32_t* facing_due, std::int32_t position, std::int32_t facing,
                       std::size_t count) {
    std::uint64_t bits = 0;
    if (count >= most) {
        constexpr Four places = {1, 2, 4, 8};
        for (std::size_t i = 0; i < most; i += 4) {
            const Four due = ((load(position_due + i) <= position) | (load(facing_due + i) <= facing)) & places;
            bits |= static_cast<std::uint64_t>(due[0] | due[1] | due[2] | due[3]) << i;
        }
        return bits;
    }
    for (std::size_t i = 0; i < count; ++i)
        bits |= static_cast<std::uint64_t>(position_due[i] <= position || facing_due[i] <= facing) << i;
    return bits;
}

template <std::size_t count>
std::int32_t least_of(const std::int32_t* values) {
    Four least = load(values);
    for (std::size_t i = 4; i < count; i += 4) {
        const Four next = load(values + i);
        least = next < least ? next : least;
    }
    return std::min(std::min(least[0], least[1]), std::min(least[2], least[3]));
}

std::int32_t bits_of(float deadline) { return std::bit_cast<std::int32_t>(deadline); }

// A float that is not after clock + slack, and but a unit or two in the last place before it.
std::int32_t deadline(float clock, float slack) {
    const float sum = clock + slack;
    return sum < std::numeric_limits<float>::max() ? std::max(bits_of(sum) - 1, 0) : never;
}

float rounded_down(double clock) { return clock > 0 ? std::nextafter(static_cast<float>(clock), 0.0f) : 0.0f; }

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
    tested_ = &criterion;
    watches_ancestors_ = !criterion.is_monotone();
}

AdjustStats CutFollower::follow(Cut& cut, const DistanceCriterion& criterion, const Viewpoint& viewpoint,
                                const FollowOptions& options) {
    stats_ = {};
    time_limit_.reset();
    if (options.milliseconds && *options.milliseconds < longest_limit_ms)
        time_limit_ = std::chrono::steady_clock::now() +
                      std::chrono::nanoseconds(static_cast<std::int64_t>(*options.milliseconds * 1e6));
    const bool is_same = is_same_request(criterion, options);
    if (!is_same) prepare(criterion, options);
    else if (tested_ != &criterion) make_tester(criterion);
    Motion motion = is_same ? FoldTester::motion(tree_, viewpoint_, viewpoint, length_per_radian_)
                            : Motion{std::numeric_limits<double>::infinity(), 0};
    if (criterion.parts().lit) motion = with_lights(motion, viewpoint);
    if (is_same && was_complete_ && motion.position == 0 && motion.facing == 0) { // nothing can have changed
        cut.begin_changes();
        cut.end_changes(stats_);
    } else if (options.triangle_budget) {
        follow_budget(cut, viewpoint, motion);
    } else {
        follow_threshold(cut, viewpoint, motion);
    }
    viewpoint_ = viewpoint;
    was_complete_ = stats_.is_complete;
    stats_.max_fold_cost = options.triangle_budget ? max_fold_cost_ : options.threshold;
    return stats_;
}

// Lights count on the facing clock: they stand still more often than the eye does.
Motion CutFollower::with_lights(Motion motion, const Viewpoint& viewpoint) const {
    const double turn = light_motion(tree_, viewpoint_.lighting, viewpoint_.eye, viewpoint.lighting, viewpoint.eye);
    motion.facing += light_weight * length_per_radian_ * turn;
    if (!(turn < longest_light_step)) motion.position = std::numeric_limits<double>::infinity();
    return motion;
}

// For a fresh start: clocks at 0, and a length for turns of the gaze.
void CutFollower::place_clocks(const Viewpoint& viewpoint) {
    const Sphere& root = tree_.bounds()[VertexTree::root()].ring;
    const double distance = glm::length(viewpoint.eye - glm::dvec3(root.centre));
    const double least = std::max(static_cast<double>(root.radius) * 1e-3, std::numeric_limits<double>::min());
    // Of a turn of the gaze as much is made as of twice the shift that the same turn would take: gazes mostly go with the view.
    length_per_radian_ = 2 * std::max(distance, least);
    set_farthest(distance + static_cast<double>(root.radius));
    set_clocks(0, 0);
    look_from(viewpoint);
}

void CutFollower::look_from(const Viewpoint& viewpoint) {
    tester_->look_from(viewpoint, length_per_radian_);
    // Nodes are at most this far away, and no farther than twice that when a deadline comes that is set now.
    const Sphere& root = tree_.bounds()[VertexTree::root()].ring;
    const double farthest = glm::length(viewpoint.eye - glm::dvec3(root.centre)) + 2 * static_cast<double>(root.radius);
    hair_ = static_cast<float>(2 * farthest) * test_rounding;
}

void CutFollower::follow_threshold(Cut& cut, const Viewpoint& viewpoint, const Motion& motion) {
    if (!(motion.position < longest_step * length_per_radian_)) {
        place_clocks(viewpoint);
        if (time_limit_) start_in_time(cut);
        else start_over(cut);
        return;
    }
    look_from(viewpoint);
    set_clocks(position_clock_ + motion.position, facing_clock_ + motion.facing);
    step(cut);
}

// ---- budgets

void CutFollower::follow_budget(Cut& cut, const Viewpoint& viewpoint, const Motion& motion) {
    const bool is_exact = options_.hysteresis <= 1 || options_.fill_budget;
    if (is_exact || !(motion.position < longest_step * length_per_radian_)) {
        place_clocks(viewpoint);
        start_with_budget(cut);
        return;
    }
    const Sphere& root = tree_.bounds()[VertexTree::root()].ring;
    set_farthest(glm::length(viewpoint.eye - glm::dvec3(root.centre)) + static_cast<double>(root.radius));
    look_from(viewpoint);
    set_clocks(position_clock_ + motion.position, facing_clock_ + motion.facing);
    cut.begin_changes();
    keep_within_budget(cut);
    cut.end_changes(stats_);
    max_fold_cost_ = threshold_;
}

void CutFollower::start_with_budget(Cut& cut) {
    const VertexTree* const tree = &tree_;
    const FoldTester* const tester = &*tester_;
    const auto is_out = [this] { return is_out_of_time(); };
    BudgetLimits limits{*options_.triangle_budget, options_.fill_budget, false, {}};
    if (time_limit_) limits.is_out_of_time = is_out;
    BudgetDecision decision = decide_budget({&tree, 1}, {&tester, 1}, limits);
    stats_.node_tests += decision.node_tests;
    stats_.is_complete = decision.is_complete;
    max_fold_cost_ = decision.max_seen_cost;
    cut.change_to(std::move(decision.unfolded[0]), stats_);
    is_tracking_ = true;
    if (options_.hysteresis <= 1 || options_.fill_budget) {
        forget_slots();
        return;
    }
    threshold_ = std::max(decision.threshold, least_threshold);
    tester_->set_threshold(threshold_);
    watch_all_due(cut);
}

// Of the hysteresis, half (as a factor: its root) keeps nodes unfolded, and half of the rest keeps the threshold.
float CutFollower::keeping_factor() const {
    return options_.triangle_budget && options_.hysteresis > 1 ? std::sqrt(options_.hysteresis) : 1;
}

// Steps at the threshold there is, and moves it where the triangles have become too many, or so few that a better one
// can be expected. Every change of the threshold by `factor` moves all distances by that factor: at most
// (factor - 1) times twice the farthest point's distance for nodes whose slack was cut to that, as an advance of the clock.
void CutFollower::keep_within_budget(Cut& cut) {
    const double budget = *options_.triangle_budget;
    // The number of triangles goes about with the inverse square of the threshold.
    const double enough = budget / std::sqrt(static_cast<double>(options_.hysteresis));
    settle_due(cut);
    constexpr int most_rounds = 24;
    bool was_above = false;
    for (int round = 0; round < most_rounds; ++round) {
        const double triangles = cut.triangle_count();
        if (triangles > budget) {
            was_above = true;
            change_threshold(cut, static_cast<float>(std::clamp(std::sqrt(triangles / budget) * 1.002, 1.005, 1.1)));
        } else if (triangles < enough && !was_above && threshold_ > least_threshold) {
            change_threshold(cut, 1 / static_cast<float>(std::clamp(std::sqrt(budget / std::max(triangles, 1.0)) * 0.99, 1.005, 1.1)));
        } else {
            return;
        }
    }
    if (cut.triangle_count() > budget) { // jumps in the number of triangles: from scratch
        cut.end_changes(stats_);
        start_with_budget(cut);
        cut.begin_changes();
    }
}

void CutFollower::change_threshold(Cut& cut, float factor) {
    threshold_ = std::max(threshold_ * factor, least_threshold);
    tester_->set_threshold(threshold_);
    const double share = factor > 1 ? factor - 1 : 1 / factor - 1;
    set_clocks(position_clock_ + 2 * share * farthest_, facing_clock_);
    settle_due(cut);
}

// ---- from scratch

void CutFollower::forget_slots() {
    // Node by node where these are few, so that the cost does not go with the tree.
    if (slot_of_node_.empty()) slot_of_node_.assign(tree_.interior_count(), no_slot);
    const std::size_t many = slot_of_node_.size() / 32;
    if (candidates_.size() > many) std::ranges::fill(slot_of_node_, no_slot);
    else for (const FoldCandidate& candidate : candidates_) slot_of_node_[candidate.node] = no_slot;
    candidates_.clear();
    blocks_.clear();
    block_position_due_.clear();
    block_facing_due_.clear();
    free_slots_.clear();
}

void CutFollower::start_over(Cut& cut) {
    is_tracking_ = true;
    forget_slots();
    std::vector<std::uint64_t> unfolded((std::size_t{tree_.interior_count()} + 63) / 64);
    // Level by level from the root down to subtrees that fit a core's cache, then one of these after the other: tests want batches,
    // and memory wants neighbours. The slots lie in the same order, which is what later frames profit from.
    std::vector<NodeId> subtrees;
    parents_.clear();
    test_down(VertexTree::root(), unfolded, &subtrees);
    std::sort(subtrees.begin(), subtrees.end());
    for (const NodeId node : subtrees) test_down(node, unfolded, nullptr);
    if (!watches_ancestors_)
        for (const NodeId node : parents_)
            if (has_unfolded_child(node, unfolded)) unwatch(node);
    cut.change_to(std::move(unfolded), stats_);
}

// The worst folds first, as far as the time goes; all live nodes are due at the next call.
void CutFollower::start_in_time(Cut& cut) {
    const VertexTree* const tree = &tree_;
    const FoldTester* const tester = &*tester_;
    const auto is_out = [this] { return is_out_of_time(); };
    BudgetLimits limits;
    limits.only_unfolding = true;
    limits.is_out_of_time = is_out;
    BudgetDecision decision = decide_budget({&tree, 1}, {&tester, 1}, limits);
    stats_.node_tests += decision.node_tests;
    stats_.is_complete = decision.is_complete;
    cut.change_to(std::move(decision.unfolded[0]), stats_);
    is_tracking_ = true;
    watch_all_due(cut);
}

void CutFollower::watch_all_due(const Cut& cut) {
    forget_slots();
    const auto subtree_end = tree_.subtree_end();
    for (NodeId node = 0; node < tree_.interior_count();) {
        const bool is_unfolded = cut.is_unfolded_interior(node);
        if (!is_unfolded || watches_ancestors_ || !has_unfolded_child(node, cut.unfolded_)) {
            FoldCandidate candidate = tester_->candidate(node);
            candidate.is_unfolded = is_unfolded;
            set_deadlines(watch(candidate), Verdict{});
        }
        node = is_unfolded ? node + 1 : subtree_end[node];
    }
}

bool CutFollower::is_out_of_time() const { return time_limit_ && std::chrono::steady_clock::now() >= *time_limit_; }

// Tests a subtree as far down as it unfolds. Children with subtrees of cache size are left to the caller where `left` is given, and
// their parents to parents_.
void CutFollower::test_down(NodeId top, std::vector<std::uint64_t>& unfolded, std::vector<NodeId>* left) {
    constexpr NodeId cached_nodes = 4096; // about 200 KB of what is read of them
    const auto subtree_end = tree_.subtree_end();
    wave_.assign(1, top);
    while (!wave_.empty()) {
        watch_wave();
        next_wave_.clear();
        for (const Slot slot : wave_slots_) {
            if (!candidates_[slot].is_unfolded) continue;
            const NodeId node = candidates_[slot].node;
            unfolded[node >> 6] |= std::uint64_t{1} << (node & 63);
            if (node != top && !watches_ancestors_) unwatch(tree_.parents()[node]);
            bool leaves_children = false;
            for (NodeId child = node + 1; child < subtree_end[node]; child = subtree_end[child]) {
                const bool is_left = left && subtree_end[child] - child <= cached_nodes;
                (is_left ? *left : next_wave_).push_back(child);
                leaves_children |= is_left;
            }
            if (leaves_children) parents_.push_back(node);
        }
        wave_.swap(next_wave_);
    }
}

// Watches and tests the nodes of the wave.
void CutFollower::watch_wave() {
    constexpr std::size_t ahead = 16; // tests between a node's prefetch and its use
    wave_slots_.clear();
    for (std::size_t i = 0; i < wave_.size(); ++i) {
        if (i + ahead < wave_.size()) tester_->prefetch(wave_[i + ahead]);
        wave_slots_.push_back(watch(tester_->candidate(wave_[i])));
    }
    verdicts_.resize(wave_.size());
    tester_->test(candidates_, wave_slots_, verdicts_);
    stats_.node_tests += wave_.size();
    for (std::size_t i = 0; i < wave_.size(); ++i) {
        set_deadlines(wave_slots_[i], verdicts_[i]);
        candidates_[wave_slots_[i]].is_unfolded = verdicts_[i].unfolded && tree_.is_sound(wave_[i]);
    }
}

// ---- from frame to frame

void CutFollower::step(Cut& cut) {
    collect_due();
    const std::size_t watched = candidates_.size() - free_slots_.size();
    if (static_cast<double>(due_.size()) > most_due * static_cast<double>(watched) && !time_limit_) {
        set_clocks(0, 0);
        start_over(cut);
        return;
    }
    cut.begin_changes();
    settle(cut);
    cut.end_changes(stats_);
}

void CutFollower::settle_due(Cut& cut) {
    collect_due();
    settle(cut);
}

void CutFollower::collect_due() {
    due_.clear();
    due_blocks_.clear();
    // In floats the clock may be a little late.
    const std::int32_t position = bits_of(std::nextafter(static_cast<float>(position_clock_), 1e30f));
    const std::int32_t facing = bits_of(std::nextafter(static_cast<float>(facing_clock_), 1e30f));
    const std::size_t blocks = blocks_.size();
    for (std::size_t first = 0; first < blocks; first += 64) {
        for (std::uint64_t due = due_bits<64>(&block_position_due_[first], &block_facing_due_[first], position, facing, blocks - first);
             due; due &= due - 1) {
            const std::size_t block = first + static_cast<std::size_t>(std::countr_zero(due));
            prefetch(&blocks_[block].position_due);
            prefetch(&blocks_[block].facing_due);
            due_blocks_.push_back(static_cast<std::uint32_t>(block));
        }
    }
    for (const std::uint32_t block : due_blocks_) {
        const Block& dues = blocks_[block];
        for (std::uint64_t due = due_bits<block_slots>(dues.position_due.data(), dues.facing_due.data(), position, facing, block_slots); due;
             due &= due - 1) {
            const std::size_t slot = block * block_slots + static_cast<std::size_t>(std::countr_zero(due));
            prefetch(&candidates_[slot]);
            due_.push_back(static_cast<Slot>(slot));
        }
    }
}

// Tests what is due, folds what has to go, and unfolds what has to come, with all that follows above and under it.
void CutFollower::settle(Cut& cut) {
    folding_.clear();
    parents_.clear();
    wave_.clear();
    // In pieces, between which the clock is looked at; what is not reached stays due.
    constexpr std::size_t piece = 2048;
    for (std::size_t first = 0; first < due_.size(); first += piece) {
        if (first > 0 && is_out_of_time()) {
            stats_.is_complete = false;
            break;
        }
        test_due(std::span(due_).subspan(first, std::min(piece, due_.size() - first)));
    }
    while (!folding_.empty() || !parents_.empty()) {
        fold_wave(cut);
        test_parents(cut);
    }
    unfold_wave(cut);
    for (const std::uint32_t block : due_blocks_) refresh_block(block);
    if (std::max(position_clock_, facing_clock_) > longest_run * length_per_radian_) restart_clocks();
}

void CutFollower::test_due(std::span<const Slot> slots) {
    if (keeping_factor() == 1) {
        test_slots(slots);
        return;
    }
    for (const bool unfolded : {true, false}) {
        kept_.clear();
        for (const Slot slot : slots)
            if (candidates_[slot].is_unfolded == unfolded) kept_.push_back(slot);
        use_threshold_of(unfolded);
        test_slots(kept_);
    }
}

void CutFollower::test_slots(std::span<const Slot> slots) {
    verdicts_.resize(slots.size());
    tester_->test(candidates_, slots, verdicts_);
    stats_.node_tests += slots.size();
    for (std::size_t i = 0; i < slots.size(); ++i) {
        const FoldCandidate& candidate = candidates_[slots[i]];
        const Verdict& verdict = verdicts_[i];
        set_deadlines(slots[i], verdict);
        if (candidate.is_unfolded && !verdict.unfolded) folding_.push_back(candidate.node);
        else if (candidate.is_unfolded && stands_by_a_hair(verdict)) ask_parent(candidate.node);
        else if (verdict.unfolded && !candidate.is_unfolded && tree_.is_sound(candidate.node)) wave_.push_back(candidate.node);
    }
}

// Folds with all that is under it what the last tests want folded, the lowest nodes first; what is above may want to fold now.
void CutFollower::fold_wave(Cut& cut) {
    std::sort(folding_.begin(), folding_.end(), std::greater<>());
    const auto subtree_end = tree_.subtree_end();
    for (std::size_t i = 0; i < folding_.size(); ++i) {
        if (i % changes_at_once == 0)
            cut.prefetch_changes(std::span(folding_).subspan(i, std::min(changes_at_once, folding_.size() - i)), true);
        const NodeId node = folding_[i];
        if (!cut.is_unfolded_interior(node)) continue;
        cut.fold_below(node, [&](NodeId folded) {
            for (NodeId child = folded + 1; child < subtree_end[folded]; child = subtree_end[child]) unwatch(child);
        });
        candidates_[slot_of_node_[node]].is_unfolded = false;
        ask_parent(node);
    }
    folding_.clear();
}

void CutFollower::ask_parent(NodeId node) {
    if (node != VertexTree::root() && !watches_ancestors_) parents_.push_back(tree_.parents()[node]);
}

// Nodes that are watched are left to their deadlines.
void CutFollower::test_parents(const Cut& cut) {
    std::sort(parents_.begin(), parents_.end());
    parents_.erase(std::unique(parents_.begin(), parents_.end()), parents_.end());
    std::erase_if(parents_, [&](NodeId node) { return !cut.is_unfolded_interior(node) || slot_of_node_[node] != no_slot; });
    parent_candidates_.clear();
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
        if (!verdicts_[i].unfolded || !has_unfolded_child(node, cut.unfolded_)) set_deadlines(watch(parent_candidates_[i]), verdicts_[i]);
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

// What unfolds, and then what unfolds under it. Where the time ends, the rest stays due.
void CutFollower::unfold_wave(Cut& cut) {
    const auto subtree_end = tree_.subtree_end();
    std::sort(wave_.begin(), wave_.end());
    constexpr std::size_t times_checked = 64; // unfolds between two looks at the clock: some microseconds
    std::size_t unfolded = 0;
    while (!wave_.empty()) {
        next_wave_.clear();
        for (std::size_t i = 0; i < wave_.size(); ++i) {
            const NodeId node = wave_[i];
            if (i % changes_at_once == 0) cut.prefetch_changes(std::span(wave_).subspan(i, std::min(changes_at_once, wave_.size() - i)), false);
            if (slot_of_node_[node] == no_slot) continue; // an ancestor has folded
            if ((++unfolded % times_checked) == 0 && is_out_of_time()) stats_.is_complete = false;
            if (!stats_.is_complete) {
                set_deadlines(slot_of_node_[node], Verdict{});
                continue;
            }
            cut.apply_unfold(node);
            candidates_[slot_of_node_[node]].is_unfolded = true;
            if (node != VertexTree::root() && !watches_ancestors_) unwatch(tree_.parents()[node]);
            for (NodeId child = node + 1; child < subtree_end[node]; child = subtree_end[child]) {
                tester_->prefetch(child);
                next_wave_.push_back(child);
            }
        }
        wave_.clear();
        wave_slots_.clear();
        for (const NodeId node : next_wave_) wave_slots_.push_back(watch(tester_->candidate(node)));
        test_slots(wave_slots_); // refills the wave
    }
}

// ---- slots

bool CutFollower::has_unfolded_child(NodeId node, std::span<const std::uint64_t> unfolded) const {
    const auto subtree_end = tree_.subtree_end();
    for (NodeId child = node + 1; child < subtree_end[node]; child = subtree_end[child])
        if ((unfolded[child >> 6] >> (child & 63)) & 1) return true;
    return false;
}

CutFollower::Slot CutFollower::watch(const FoldCandidate& candidate) {
    Slot slot;
    if (free_slots_.empty()) {
        slot = static_cast<Slot>(candidates_.size());
        if (slot % block_slots == 0) {
            Block& block = blocks_.emplace_back();
            block.position_due.fill(never);
            block.facing_due.fill(never);
            block_position_due_.push_back(never);
            block_facing_due_.push_back(never);
        }
        candidates_.push_back(candidate);
    } else {
        slot = free_slots_.back();
        free_slots_.pop_back();
        candidates_[slot] = candidate;
    }
    slot_of_node_[candidate.node] = slot;
    return slot;
}

// Also where it is not watched.
void CutFollower::unwatch(NodeId node) {
    const Slot slot = slot_of_node_[node];
    if (slot == no_slot) return;
    slot_of_node_[node] = no_slot;
    Block& block = blocks_[slot / block_slots];
    block.position_due[slot % block_slots] = block.facing_due[slot % block_slots] = never;
    free_slots_.push_back(slot);
}

// Unfolded nodes speak for their ancestors, too, whose tests round in their own way.
void CutFollower::set_deadlines(Slot slot, const Verdict& verdict) {
    const std::size_t block = slot / block_slots;
    const float hair = verdict.unfolded ? hair_ : 0;
    const float position_slack = std::min(verdict.position_slack, longest_slack_);
    const std::int32_t position = deadline(position_clock_down_, std::max(position_slack - hair, 0.0f));
    const std::int32_t facing = deadline(facing_clock_down_, std::max(verdict.facing_slack - hair, 0.0f));
    blocks_[block].position_due[slot % block_slots] = position;
    blocks_[block].facing_due[slot % block_slots] = facing;
    block_position_due_[block] = std::min(block_position_due_[block], position);
    block_facing_due_[block] = std::min(block_facing_due_[block], facing);
}

void CutFollower::set_clocks(double position, double facing) {
    position_clock_ = position;
    facing_clock_ = facing;
    position_clock_down_ = rounded_down(position);
    facing_clock_down_ = rounded_down(facing);
}

void CutFollower::refresh_block(std::size_t block) {
    block_position_due_[block] = least_of<block_slots>(blocks_[block].position_due.data());
    block_facing_due_[block] = least_of<block_slots>(blocks_[block].facing_due.data());
}

// Sets both clocks to 0, and all deadlines back by what they showed.
void CutFollower::restart_clocks() {
    const auto set_back = [](std::array<std::int32_t, block_slots>& dues, double clock) {
        for (std::int32_t& due : dues) {
            if (due == never) continue;
            const double left = static_cast<double>(std::bit_cast<float>(due)) - clock;
            due = left > 0 ? bits_of(std::nextafter(static_cast<float>(left), 0.0f)) : 0;
        }
    };
    for (Block& block : blocks_) {
        set_back(block.position_due, position_clock_);
        set_back(block.facing_due, facing_clock_);
    }
    set_clocks(0, 0);
    for (std::size_t block = 0; block < blocks_.size(); ++block) refresh_block(block);
}

std::uint64_t CutFollower::byte_size() const noexcept {
    return sizeof(FoldCandidate) * candidates_.capacity() + sizeof(Block) * blocks_.capacity() +
           sizeof(std::int32_t) * (block_position_due_.capacity() + block_facing_due_.capacity()) +
           sizeof(Slot) * (free_slots_.capacity() + slot_of_node_.capacity());
}

} // namespace unseen::vdtree
