#include "cut_follower.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include <glm/geometric.hpp>

#include "budget.h"

namespace unseen::vdtree {

namespace {

constexpr std::int32_t never = std::numeric_limits<std::int32_t>::max();

// Clocks restart when they have run this many times the distance to the tree, so that deadlines in floats stay fine enough.
constexpr double longest_run = 16;
// With more than this share of the live nodes due, testing all of them from the root down is cheaper.
constexpr std::size_t most_due = 3; // one in three
// Beyond this step a good part of all verdicts would be due anyway. In lengths for a radian: twice the tree's distance.
constexpr double longest_step = 0.125;
// A budget that holds everything has the threshold 0; this stands for it.
constexpr float least_threshold = 1e-30f;
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
    const Motion motion = is_same ? FoldTester::motion(tree_, viewpoint_, viewpoint, length_per_radian_)
                                  : Motion{std::numeric_limits<double>::infinity(), 0};
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

// For a fresh start: clocks at 0, and a length for turns of the gaze.
void CutFollower::place_clocks(const Viewpoint& viewpoint) {
    const Sphere& root = tree_.bounds()[VertexTree::root()].ring;
    const double distance = glm::length(viewpoint.eye - glm::dvec3(root.centre));
    const double least = std::max(static_cast<double>(root.radius) * 1e-3, std::numeric_limits<double>::min());
    // Of a turn of the gaze as much is made as of twice the shift that the same turn would take: gazes mostly go with the view.
    length_per_radian_ = 2 * std::max(distance, least);
    set_farthest(distance + static_cast<double>(root.radius));
    set_clocks(0, 0);
    tester_->look_from(viewpoint, length_per_radian_);
}

void CutFollower::follow_threshold(Cut& cut, const Viewpoint& viewpoint, const Motion& motion) {
    if (!(motion.position < longest_step * length_per_radian_)) {
        place_clocks(viewpoint);
        if (time_limit_) start_in_time(cut);
        else start_over(cut);
        return;
    }
    tester_->look_from(viewpoint, length_per_radian_);
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
    tester_->look_from(viewpoint, length_per_radian_);
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
    make_all_due(cut);
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
    // Node by node, so that the cost does not go with the tree.
    if (slot_of_node_.empty()) slot_of_node_.assign(tree_.interior_count(), no_slot);
    for (const NodeId node : node_) slot_of_node_[node] = no_slot;
    node_.clear();
    position_due_.clear();
    facing_due_.clear();
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
    test_down(VertexTree::root(), unfolded, &subtrees);
    std::sort(subtrees.begin(), subtrees.end());
    for (const NodeId node : subtrees) test_down(node, unfolded, nullptr);
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
    make_all_due(cut);
}

void CutFollower::make_all_due(const Cut& cut) {
    forget_slots();
    const auto subtree_end = tree_.subtree_end();
    const Verdict due{};
    for (NodeId node = 0; node < tree_.interior_count(); node = cut.is_unfolded_interior(node) ? node + 1 : subtree_end[node]) {
        set_deadlines(add_live(node), due);
    }
}

bool CutFollower::is_out_of_time() const { return time_limit_ && std::chrono::steady_clock::now() >= *time_limit_; }

// Tests a subtree as far down as it unfolds. Children with subtrees of cache size are left to the caller where `left` is given.
void CutFollower::test_down(NodeId top, std::vector<std::uint64_t>& unfolded, std::vector<NodeId>* left) {
    constexpr NodeId cached_nodes = 4096; // about 200 KB of what is read of them
    const auto subtree_end = tree_.subtree_end();
    wave_.assign(1, top);
    while (!wave_.empty()) {
        verdicts_.resize(wave_.size());
        tester_->test(wave_, verdicts_);
        stats_.node_tests += wave_.size();
        next_wave_.clear();
        for (std::size_t i = 0; i < wave_.size(); ++i) {
            const NodeId node = wave_[i];
            set_deadlines(add_live(node), verdicts_[i]);
            if (!verdicts_[i].unfolded || !tree_.is_sound(node)) continue;
            unfolded[node >> 6] |= std::uint64_t{1} << (node & 63);
            for (NodeId child = node + 1; child < subtree_end[node]; child = subtree_end[child])
                (left && subtree_end[child] - child <= cached_nodes ? *left : next_wave_).push_back(child);
        }
        wave_.swap(next_wave_);
    }
}

// ---- from frame to frame

void CutFollower::step(Cut& cut) {
    collect_due();
    const std::size_t live = node_.size() - free_slots_.size();
    if (due_.size() > live / most_due && !time_limit_) {
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
    due_slots_.clear();
    due_blocks_.clear();
    // In floats the clock may be a little late.
    const std::int32_t position = bits_of(std::nextafter(static_cast<float>(position_clock_), 1e30f));
    const std::int32_t facing = bits_of(std::nextafter(static_cast<float>(facing_clock_), 1e30f));
    const std::size_t blocks = block_position_due_.size();
    for (std::size_t first = 0; first < blocks; first += 64)
        for (std::uint64_t due = due_bits<64>(&block_position_due_[first], &block_facing_due_[first], position, facing, blocks - first);
             due; due &= due - 1)
            due_blocks_.push_back(static_cast<std::uint32_t>(first + static_cast<std::size_t>(std::countr_zero(due))));
    for (const std::uint32_t block : due_blocks_) {
        const std::size_t first = block * block_slots;
        for (std::uint64_t due = due_bits<block_slots>(&position_due_[first], &facing_due_[first], position, facing, block_slots); due;
             due &= due - 1) {
            const std::size_t slot = first + static_cast<std::size_t>(std::countr_zero(due));
            due_slots_.push_back(static_cast<Slot>(slot));
            due_.push_back(node_[slot]);
        }
    }
}

// Tests what is due, folds what has to go, and unfolds what has to come, with all that follows under it.
void CutFollower::settle(Cut& cut) {
    folding_.clear();
    wave_.clear();
    // In pieces, between which the clock is looked at; what is not reached stays due.
    constexpr std::size_t piece = 2048;
    for (std::size_t first = 0; first < due_.size(); first += piece) {
        if (first > 0 && is_out_of_time()) {
            stats_.is_complete = false;
            break;
        }
        const std::size_t count = std::min(piece, due_.size() - first);
        test_due(cut, std::span(due_).subspan(first, count), std::span(due_slots_).subspan(first, count));
    }
    // Ancestors first: what they fold is gone.
    std::sort(folding_.begin(), folding_.end());
    for (const NodeId node : folding_)
        if (cut.is_unfolded_interior(node)) cut.fold_below(node, [&](NodeId folded) { remove_children(folded); });
    unfold_wave(cut);
    for (const std::uint32_t block : due_blocks_) refresh_block(block);
    if (std::max(position_clock_, facing_clock_) > longest_run * length_per_radian_) restart_clocks();
}

void CutFollower::test_due(const Cut& cut, std::span<const NodeId> nodes, std::span<const Slot> slots) {
    const float keeping = keeping_factor();
    if (keeping == 1) {
        test_nodes(cut, nodes, slots);
        return;
    }
    // What is unfolded stays so down to a somewhat lower cost.
    for (const bool unfolded : {true, false}) {
        kept_.clear();
        kept_slots_.clear();
        for (std::size_t i = 0; i < nodes.size(); ++i) {
            if (cut.is_unfolded_interior(nodes[i]) != unfolded) continue;
            kept_.push_back(nodes[i]);
            kept_slots_.push_back(slots[i]);
        }
        tester_->set_threshold(unfolded ? threshold_ / keeping : threshold_);
        test_nodes(cut, kept_, kept_slots_);
    }
}

void CutFollower::test_nodes(const Cut& cut, std::span<const NodeId> nodes, std::span<const Slot> slots) {
    verdicts_.resize(nodes.size());
    tester_->test(nodes, verdicts_);
    stats_.node_tests += nodes.size();
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        const NodeId node = nodes[i];
        set_deadlines(slots[i], verdicts_[i]);
        const bool was_unfolded = cut.is_unfolded_interior(node);
        if (was_unfolded == verdicts_[i].unfolded) continue;
        if (was_unfolded) folding_.push_back(node);
        else if (tree_.is_sound(node)) wave_.push_back(node);
    }
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
            cut.prefetch_unfolds(wave_, i);
            if (slot_of_node_[node] == no_slot) continue; // an ancestor has folded
            if ((++unfolded % times_checked) == 0 && is_out_of_time()) stats_.is_complete = false;
            if (!stats_.is_complete) {
                set_deadlines(slot_of_node_[node], Verdict{});
                continue;
            }
            cut.apply_unfold(node);
            for (NodeId child = node + 1; child < subtree_end[node]; child = subtree_end[child]) {
                add_live(child);
                next_wave_.push_back(child);
            }
        }
        verdicts_.resize(next_wave_.size());
        tester_->test(next_wave_, verdicts_);
        stats_.node_tests += next_wave_.size();
        wave_.clear();
        for (std::size_t i = 0; i < next_wave_.size(); ++i) {
            set_deadlines(slot_of_node_[next_wave_[i]], verdicts_[i]);
            if (verdicts_[i].unfolded && tree_.is_sound(next_wave_[i])) wave_.push_back(next_wave_[i]);
        }
    }
}

// ---- slots

CutFollower::Slot CutFollower::add_live(NodeId node) {
    Slot slot;
    if (free_slots_.empty()) {
        slot = static_cast<Slot>(node_.size());
        if (slot % block_slots == 0) {
            position_due_.resize(slot + block_slots, never);
            facing_due_.resize(slot + block_slots, never);
            block_position_due_.push_back(never);
            block_facing_due_.push_back(never);
        }
        node_.push_back(node);
    } else {
        slot = free_slots_.back();
        free_slots_.pop_back();
        node_[slot] = node;
    }
    slot_of_node_[node] = slot;
    return slot;
}

void CutFollower::remove_children(NodeId node) {
    const auto subtree_end = tree_.subtree_end();
    for (NodeId child = node + 1; child < subtree_end[node]; child = subtree_end[child]) {
        const Slot slot = slot_of_node_[child];
        slot_of_node_[child] = no_slot;
        position_due_[slot] = facing_due_[slot] = never;
        free_slots_.push_back(slot);
    }
}

void CutFollower::set_deadlines(Slot slot, const Verdict& verdict) {
    const std::size_t block = slot / block_slots;
    const std::int32_t position = deadline(position_clock_down_, std::min(verdict.position_slack, longest_slack_));
    const std::int32_t facing = deadline(facing_clock_down_, verdict.facing_slack);
    position_due_[slot] = position;
    facing_due_[slot] = facing;
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
    const std::size_t first = block * block_slots;
    block_position_due_[block] = least_of<block_slots>(&position_due_[first]);
    block_facing_due_[block] = least_of<block_slots>(&facing_due_[first]);
}

// Sets both clocks to 0, and all deadlines back by what they showed.
void CutFollower::restart_clocks() {
    const auto set_back = [](std::vector<std::int32_t>& dues, double clock) {
        for (std::int32_t& due : dues) {
            if (due == never) continue;
            const double left = static_cast<double>(std::bit_cast<float>(due)) - clock;
            due = left > 0 ? bits_of(std::nextafter(static_cast<float>(left), 0.0f)) : 0;
        }
    };
    set_back(position_due_, position_clock_);
    set_back(facing_due_, facing_clock_);
    set_clocks(0, 0);
    for (std::size_t block = 0; block < block_position_due_.size(); ++block) refresh_block(block);
}

std::uint64_t CutFollower::byte_size() const noexcept {
    return sizeof(NodeId) * node_.capacity() + sizeof(std::int32_t) * (position_due_.capacity() + facing_due_.capacity()) +
           sizeof(std::int32_t) * (block_position_due_.capacity() + block_facing_due_.capacity()) +
           sizeof(Slot) * (free_slots_.capacity() + slot_of_node_.capacity());
}

} // namespace unseen::vdtree
