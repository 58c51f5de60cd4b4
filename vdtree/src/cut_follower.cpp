#include "cut_follower.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include <glm/geometric.hpp>

namespace unseen::vdtree {

namespace {

constexpr std::int32_t never = std::numeric_limits<std::int32_t>::max();

// Clocks restart when they have run this many times the distance to the tree, so that deadlines in floats stay fine enough.
constexpr double longest_run = 16;
// With more than this share of the live nodes due, testing all of them from the root down is cheaper.
constexpr std::size_t most_due = 3; // one in three

std::int32_t bits_of(float deadline) { return std::bit_cast<std::int32_t>(deadline); }

} // namespace

// The latest float that is not after clock + slack.
std::int32_t CutFollower::deadline(double clock, float slack) const {
    if (!(slack < std::numeric_limits<float>::max())) return never;
    const double exact = clock + static_cast<double>(slack);
    float rounded = static_cast<float>(exact);
    if (static_cast<double>(rounded) > exact) rounded = std::nextafter(rounded, 0.0f);
    return bits_of(rounded);
}

AdjustStats CutFollower::follow(Cut& cut, const DistanceCriterion& criterion, const Viewpoint& viewpoint, bool cull_back_faces,
                                float threshold) {
    stats_ = {};
    const bool is_same = is_tracking_ && criterion.id() == criterion_ && cull_back_faces == cull_back_faces_ && threshold == threshold_;
    const Motion motion = is_same ? FoldTester::motion(tree_, viewpoint_, viewpoint, length_per_radian_)
                                  : Motion{std::numeric_limits<double>::infinity(), 0};
    if (is_same && motion.position == 0 && motion.facing == 0) { // nothing can have changed
        cut.begin_changes();
        cut.end_changes(stats_);
        return stats_;
    }

    criterion_ = criterion.id();
    cull_back_faces_ = cull_back_faces;
    threshold_ = threshold;
    viewpoint_ = viewpoint;
    FoldTester tester(tree_, criterion, cull_back_faces, threshold);
    // Beyond this a good part of all verdicts would be due anyway.
    constexpr double longest_step = 0.25; // distances to the tree's centre
    if (!(motion.position < longest_step * length_per_radian_)) {
        const Sphere& root = tree_.bounds()[VertexTree::root()].ring;
        const double distance = glm::length(viewpoint.eye - glm::dvec3(root.centre));
        const double least = std::max(static_cast<double>(root.radius) * 1e-3, std::numeric_limits<double>::min());
        // Of a turn of the gaze as much is made as of twice the shift that the same turn would take: gazes mostly go with the view.
        length_per_radian_ = 2 * std::max(distance, least);
        tester.look_from(viewpoint, length_per_radian_);
        start_over(cut, tester);
    } else {
        tester.look_from(viewpoint, length_per_radian_);
        position_clock_ += motion.position;
        facing_clock_ += motion.facing;
        step(cut, tester);
    }
    return stats_;
}

// ---- from scratch

void CutFollower::start_over(Cut& cut, const FoldTester& tester) {
    is_tracking_ = true;
    position_clock_ = facing_clock_ = 0;
    node_.clear();
    position_due_.clear();
    facing_due_.clear();
    block_position_due_.clear();
    block_facing_due_.clear();
    free_slots_.clear();
    slot_of_node_.assign(tree_.interior_count(), no_slot);

    std::vector<std::uint64_t> unfolded((std::size_t{tree_.interior_count()} + 63) / 64);
    // Level by level from the root down to subtrees that fit a core's cache, then one of these after the other: tests want batches,
    // and memory wants neighbours. The slots lie in the same order, which is what later frames profit from.
    std::vector<NodeId> subtrees;
    test_down(VertexTree::root(), tester, unfolded, &subtrees);
    std::sort(subtrees.begin(), subtrees.end());
    for (const NodeId node : subtrees) test_down(node, tester, unfolded, nullptr);
    cut.change_to(std::move(unfolded), stats_);
}

// Tests a subtree as far down as it unfolds. Children with subtrees of cache size are left to the caller where `left` is given.
void CutFollower::test_down(NodeId top, const FoldTester& tester, std::vector<std::uint64_t>& unfolded, std::vector<NodeId>* left) {
    constexpr NodeId cached_nodes = 4096; // about 200 KB of what is read of them
    const auto subtree_end = tree_.subtree_end();
    wave_.assign(1, top);
    while (!wave_.empty()) {
        verdicts_.resize(wave_.size());
        tester.test(wave_, verdicts_);
        stats_.node_tests += wave_.size();
        next_wave_.clear();
        for (std::size_t i = 0; i < wave_.size(); ++i) {
            const NodeId node = wave_[i];
            add_live(node);
            set_deadlines(node, verdicts_[i]);
            if (!verdicts_[i].unfolded || !tree_.is_sound(node)) continue;
            unfolded[node >> 6] |= std::uint64_t{1} << (node & 63);
            for (NodeId child = node + 1; child < subtree_end[node]; child = subtree_end[child])
                (left && subtree_end[child] - child <= cached_nodes ? *left : next_wave_).push_back(child);
        }
        wave_.swap(next_wave_);
    }
}

// ---- from frame to frame

void CutFollower::step(Cut& cut, const FoldTester& tester) {
    collect_due();
    const std::size_t live = node_.size() - free_slots_.size();
    if (due_.size() > live / most_due) {
        start_over(cut, tester);
        return;
    }
    cut.begin_changes();
    settle(cut, tester);
    cut.end_changes(stats_);
    for (const std::uint32_t block : due_blocks_) refresh_block(block);
    if (std::max(position_clock_, facing_clock_) > longest_run * length_per_radian_) restart_clocks();
}

void CutFollower::collect_due() {
    due_.clear();
    due_blocks_.clear();
    // In floats the clock may be a little late.
    const std::int32_t position = bits_of(std::nextafter(static_cast<float>(position_clock_), 1e30f));
    const std::int32_t facing = bits_of(std::nextafter(static_cast<float>(facing_clock_), 1e30f));
    const std::size_t blocks = block_position_due_.size();
    for (std::size_t block = 0; block < blocks; ++block)
        if (block_position_due_[block] <= position || block_facing_due_[block] <= facing) due_blocks_.push_back(static_cast<std::uint32_t>(block));
    for (const std::uint32_t block : due_blocks_) collect_block(block, position, facing);
}

void CutFollower::collect_block(std::size_t block, std::int32_t position, std::int32_t facing) {
    const std::size_t first = block * block_slots;
    const std::int32_t *p = &position_due_[first], *f = &facing_due_[first];
    alignas(64) std::uint8_t is_due[block_slots];
    for (std::size_t i = 0; i < block_slots; ++i) is_due[i] = (p[i] <= position) | (f[i] <= facing);
    for (std::size_t eight = 0; eight < block_slots; eight += 8) {
        std::uint64_t any;
        std::memcpy(&any, is_due + eight, sizeof any);
        if (!any) continue;
        for (std::size_t i = eight; i < eight + 8; ++i)
            if (is_due[i]) due_.push_back(node_[first + i]);
    }
}

// Tests what is due, folds what has to go, and unfolds what has to come, with all that follows under it.
void CutFollower::settle(Cut& cut, const FoldTester& tester) {
    verdicts_.resize(due_.size());
    tester.test(due_, verdicts_);
    stats_.node_tests += due_.size();
    folding_.clear();
    wave_.clear();
    for (std::size_t i = 0; i < due_.size(); ++i) {
        const NodeId node = due_[i];
        set_deadlines(node, verdicts_[i]);
        const bool was_unfolded = cut.is_unfolded(node);
        if (was_unfolded && !verdicts_[i].unfolded) folding_.push_back(node);
        if (!was_unfolded && verdicts_[i].unfolded && tree_.is_sound(node)) wave_.push_back(node);
    }
    // Ancestors first: what they fold is gone.
    std::sort(folding_.begin(), folding_.end());
    for (const NodeId node : folding_)
        if (cut.is_unfolded(node)) cut.fold_below(node, [&](NodeId folded) { remove_children(folded); });
    unfold_wave(cut, tester);
}

void CutFollower::unfold_wave(Cut& cut, const FoldTester& tester) {
    const auto subtree_end = tree_.subtree_end();
    std::sort(wave_.begin(), wave_.end());
    while (!wave_.empty()) {
        next_wave_.clear();
        for (const NodeId node : wave_) {
            if (slot_of_node_[node] == no_slot) continue; // an ancestor has folded
            cut.apply_unfold(node);
            for (NodeId child = node + 1; child < subtree_end[node]; child = subtree_end[child]) {
                add_live(child);
                next_wave_.push_back(child);
            }
        }
        verdicts_.resize(next_wave_.size());
        tester.test(next_wave_, verdicts_);
        stats_.node_tests += next_wave_.size();
        wave_.clear();
        for (std::size_t i = 0; i < next_wave_.size(); ++i) {
            set_deadlines(next_wave_[i], verdicts_[i]);
            if (verdicts_[i].unfolded && tree_.is_sound(next_wave_[i])) wave_.push_back(next_wave_[i]);
        }
    }
}

// ---- slots

void CutFollower::add_live(NodeId node) {
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

void CutFollower::set_deadlines(NodeId node, const Verdict& verdict) {
    const Slot slot = slot_of_node_[node];
    const std::size_t block = slot / block_slots;
    position_due_[slot] = deadline(position_clock_, verdict.position_slack);
    facing_due_[slot] = deadline(facing_clock_, verdict.facing_slack);
    block_position_due_[block] = std::min(block_position_due_[block], position_due_[slot]);
    block_facing_due_[block] = std::min(block_facing_due_[block], facing_due_[slot]);
}

void CutFollower::refresh_block(std::size_t block) {
    const std::size_t first = block * block_slots;
    std::int32_t position = never, facing = never;
    for (std::size_t i = first; i < first + block_slots; ++i) position = std::min(position, position_due_[i]);
    for (std::size_t i = first; i < first + block_slots; ++i) facing = std::min(facing, facing_due_[i]);
    block_position_due_[block] = position;
    block_facing_due_[block] = facing;
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
    position_clock_ = facing_clock_ = 0;
    for (std::size_t block = 0; block < block_position_due_.size(); ++block) refresh_block(block);
}

std::uint64_t CutFollower::byte_size() const noexcept {
    return sizeof(NodeId) * node_.capacity() + sizeof(std::int32_t) * (position_due_.capacity() + facing_due_.capacity()) +
           sizeof(std::int32_t) * (block_position_due_.capacity() + block_facing_due_.capacity()) +
           sizeof(Slot) * (free_slots_.capacity() + slot_of_node_.capacity());
}

} // namespace unseen::vdtree
