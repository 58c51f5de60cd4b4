#include "cut/cut_settler.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>

#include "cut/kernel/prefetch.h"
#include "tree/unchecked_links.h"
#include "tree/walk_children.h"

namespace unseen::vdtree {

namespace {

constexpr std::size_t piece_tests = 512; // tests at once while slots are filled: what they read stays in the cache
// The data of this many changes is prefetched: some two thousand cache lines, of which the second-level cache holds several
// times as many.
constexpr std::size_t changes_at_once = 64;
// Blocks whose due nodes are tested, with what folds for it, between two looks at the clock: some microseconds.
constexpr std::size_t blocks_at_once = 16;
constexpr std::size_t unfolds_in_time = 16; // likewise

} // namespace

void CutSettler::watch_nothing() {
    front_.clear();
    waiting_.clear();
    are_costs_of_view_ = is_all_tested_ = true;
    next_due_ = 0;
}

void CutSettler::watch_all(const CutState& cut, const Rules& rules, Deadlines deadlines) {
    rules_ = rules;
    watch_border(cut, deadlines);
}

void CutSettler::watch_and_settle(CutState& cut, const Rules& rules) {
    rules_ = rules;
    begin_settling();
    watch_border(cut, Deadlines::found);
    end_settling(cut);
}

void CutSettler::watch_border(const CutState& cut, Deadlines deadlines) {
    watch_nothing();
    find_border(cut);
    front_.reserve(next_wave_.size());
    for (std::size_t first = 0; first < next_wave_.size(); first += piece_tests) {
        const auto piece = std::span(next_wave_).subspan(first, std::min(piece_tests, next_wave_.size() - first));
        candidates_.clear();
        for (std::size_t i = 0; i < piece.size(); ++i) {
            constexpr std::size_t ahead = 16; // nodes between a prefetch and its use
            if (i + ahead < piece.size()) rules_.tester->prefetch(piece[i + ahead]);
            candidates_.push_back(rules_.tester->candidate(piece[i]));
            candidates_.back().is_unfolded = cut.is_unfolded_interior(piece[i]);
        }
        rules_.tester->find_still_rows(candidates_);
        wave_slots_.clear();
        for (const FoldCandidate& candidate : candidates_) wave_slots_.push_back(front_.append(candidate));
        front_.end_append();
        if (deadlines == Deadlines::found) test_slots(wave_slots_);
        else
            for (const Slot slot : wave_slots_) front_.set_deadlines(slot, Verdict{});
    }
}

// The nodes to watch, in about their order, as the next wave.
void CutSettler::find_border(const CutState& cut) {
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
            if (is_border || rules_.watches_ancestors) next_wave_.push_back(unfolding_[at]);
    };
    walk_children(
        tree_, unfolding_.size(), [&](std::size_t i) { return unfolding_[i]; },
        [&](std::size_t i, NodeId child) {
            go_to(i);
            if (cut.is_unfolded_interior(child)) is_border = false;
            else next_wave_.push_back(child);
        });
    go_to(unfolding_.size());
}

// Tests what is due, folds what has to go, and unfolds what has to come, with all that follows above and under it.
void CutSettler::settle(CutState& cut, const Rules& rules, std::span<const Slot> due) {
    rules_ = rules;
    begin_settling();
    constexpr std::size_t piece = 2048; // what their tests read and write stays in the cache
    for (std::size_t first = 0; first < due.size(); first += piece)
        test_due(due.subspan(first, std::min(piece, due.size() - first)));
    end_settling(cut);
}

// The same in small steps, as many as the time is enough for: at least one of tests and folds, and one of unfolds. Both
// get the same time, for what is not tested keeps what is unfolded from being right, and unfolds alone make the cut
// better. What is left to do is kept.
void CutSettler::settle_in_time(CutState& cut, const Rules& rules) {
    rules_ = rules;
    using Clock = std::chrono::steady_clock;
    begin_settling();
    if (waiting_.size() > front_.size()) waiting_.drop_idle([this](NodeId node) { return waits(node); });
    front_.find_due_blocks(next_due_);
    std::size_t looked_at = 0; // blocks; splitting some adds to them
    Clock::duration testing{}, unfolding{};
    Clock::time_point now = Clock::now();
    for (int steps = 0;; ++steps) {
        const auto left = front_.due_blocks().subspan(looked_at);
        const bool can_unfold = find_worst(cut);
        if (left.empty() && !can_unfold) break;
        constexpr int least_steps = 2;
        if (steps >= least_steps && now >= *rules_.time_limit) break;
        const bool tests = !left.empty() && (!can_unfold || testing <= unfolding);
        if (tests) {
            const std::size_t count = std::min(left.size(), blocks_at_once);
            test_due(front_.collect_due(left.first(count)));
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
    const auto left = front_.due_blocks().subspan(looked_at);
    is_all_tested_ = left.empty();
    next_due_ = left.empty() ? 0 : left.front();
    front_.restart_clocks(rules_.longest_run);
}

void CutSettler::begin_settling() {
    folding_.clear();
    parents_.clear();
    wave_.clear();
}

void CutSettler::finish_folding(CutState& cut) {
    while (!folding_.empty() || !parents_.empty()) {
        fold_wave(cut);
        test_parents(cut);
    }
}

void CutSettler::end_settling(CutState& cut) {
    finish_folding(cut);
    for (const WaitingNodes::Entry& waiting : waiting_) { // of calls with a time limit
        if (!waits(waiting.node)) continue;
        front_.set_waiting(front_.slot_of(waiting.node), false);
        wave_.push_back(waiting.node);
    }
    waiting_.clear();
    is_all_tested_ = true;
    unfold_wave(cut);
    front_.restart_clocks(rules_.longest_run);
}

void CutSettler::test_due(std::span<const Slot> slots) {
    if (rules_.keeping == 1) {
        test_slots(slots);
        return;
    }
    for (const bool unfolded : {true, false}) {
        kept_.clear();
        for (const Slot slot : slots)
            if (front_[slot].is_unfolded == unfolded) kept_.push_back(slot);
        use_threshold_of(unfolded);
        test_slots(kept_);
    }
}

void CutSettler::test_slots(std::span<const Slot> slots) {
    node_tests_ += slots.size();
    TestBatch tested{};
    for (std::size_t first = 0; first < slots.size(); first += kernel_lanes) {
        const auto batch = slots.subspan(first, std::min(kernel_lanes, slots.size() - first));
        rules_.tester->test(front_.candidates(), slots, first, tested);
        front_.set_deadlines(batch, tested);
        for (std::size_t i = 0; i < batch.size(); ++i) {
            const FoldCandidate& candidate = front_[batch[i]];
            const bool unfolds = (tested.unfolded >> i) & 1;
            // Mostly nothing changes. What was folded or unfolded before is unpredictable, so branch-free.
            if (!(candidate.is_waiting | (candidate.is_unfolded != unfolds) |
                  (unfolds & front_.is_within_rounding(tested, i))))
                continue;
            if (candidate.is_waiting) {
                if (!unfolds) front_.set_waiting(batch[i], false);
            } else if (candidate.is_unfolded && !unfolds) folding_.push_back(candidate.node);
            else if (candidate.is_unfolded && front_.is_within_rounding(tested, i)) ask_parent(candidate.node);
            else if (unfolds && !candidate.is_unfolded && tree_.is_sound(candidate.node))
                wave_.push_back(candidate.node);
        }
    }
}

// What the follower itself will read and write, too.
void CutSettler::prefetch_changes(CutState& cut, std::span<const NodeId> nodes, bool folds) {
    for (const NodeId node : nodes) {
        front_.prefetch_slot(node);
        prefetch(&unchecked_links(tree_).parents[node]);
    }
    cut.prefetch_changes(nodes, folds);
    for (const NodeId node : nodes) {
        front_.prefetch_deadlines(node);
        if (const NodeId parent = unchecked_links(tree_).parents[node]; parent != no_node) front_.prefetch_slot(parent);
    }
    for (const NodeId child : cut.fetched_children()) {
        if (tree_.is_leaf(child)) continue;
        front_.prefetch_slot(child);
        if (!folds) rules_.tester->prefetch(child);
    }
    if (folds) {
        for (const NodeId child : cut.fetched_children())
            if (!tree_.is_leaf(child)) front_.prefetch_deadlines(child);
    } else {
        for (const NodeId node : nodes)
            if (const NodeId parent = unchecked_links(tree_).parents[node]; parent != no_node)
                front_.prefetch_deadlines(parent);
    }
}

// Folds with all that is under it what the last tests want folded, the lowest nodes first; what is above may want to
// fold now.
void CutSettler::fold_wave(CutState& cut) {
    std::sort(folding_.begin(), folding_.end(), std::greater<>());
    const auto subtree_end = unchecked_links(tree_).subtree_end;
    for (std::size_t i = 0; i < folding_.size(); ++i) {
        if (i % changes_at_once == 0)
            prefetch_changes(cut, std::span(folding_).subspan(i, std::min(changes_at_once, folding_.size() - i)), true);
        const NodeId node = folding_[i];
        if (!cut.is_unfolded_interior(node)) continue;
        const auto children = cut.fetched_children(i % changes_at_once);
        const auto has_fold = [&](NodeId child) { return !tree_.is_leaf(child) && cut.is_unfolded_interior(child); };
        if (std::ranges::none_of(children, has_fold)) { // nearly always
            cut.apply_fold(node, children);
            for (const NodeId child : children)
                if (!tree_.is_leaf(child)) front_.remove(child);
        } else {
            cut.fold_below(node, [&](NodeId folded) {
                for (NodeId child = folded + 1; child < subtree_end[folded]; child = subtree_end[child])
                    front_.remove(child);
            });
        }
        front_.set_unfolded(front_.slot_of(node), false);
        ask_parent(node);
    }
    folding_.clear();
}

void CutSettler::ask_parent(NodeId node) {
    if (node != VertexTree::root() && !rules_.watches_ancestors)
        parents_.push_back(unchecked_links(tree_).parents[node]);
}

// Nodes that are watched are left to their deadlines.
void CutSettler::test_parents(const CutState& cut) {
    std::sort(parents_.begin(), parents_.end());
    parents_.erase(std::unique(parents_.begin(), parents_.end()), parents_.end());
    std::erase_if(parents_,
                  [&](NodeId node) { return !cut.is_unfolded_interior(node) || front_.slot_of(node) != no_slot; });
    candidates_.clear();
    for (const NodeId node : parents_) {
        rules_.tester->prefetch(node);
        prefetch(&unchecked_links(tree_).subtree_end[node]);
    }
    for (const NodeId node : parents_) {
        candidates_.push_back(rules_.tester->candidate(node));
        candidates_.back().is_unfolded = true;
    }
    parents_.clear();
    if (candidates_.empty()) return;
    rules_.tester->find_still_rows(candidates_);
    use_threshold_of(true);
    verdicts_.resize(candidates_.size());
    rules_.tester->test(candidates_, verdicts_);
    node_tests_ += candidates_.size();
    for (std::size_t i = 0; i < candidates_.size(); ++i) {
        const NodeId node = candidates_[i].node;
        if (!verdicts_[i].unfolded || !has_unfolded_child(node, cut.unfolded()))
            front_.set_deadlines(front_.insert(candidates_[i], near_children_of(node)), verdicts_[i]);
        if (!verdicts_[i].unfolded) folding_.push_back(node);
        else if (front_.is_within_rounding(verdicts_[i])) ask_parent(node);
    }
    use_threshold_of(false);
}

// With hysteresis, what is unfolded stays so down to a somewhat lower cost.
void CutSettler::use_threshold_of(bool unfolded) {
    if (rules_.keeping > 1)
        rules_.tester->set_threshold(unfolded ? rules_.threshold / rules_.keeping : rules_.threshold);
}

// Watches the children of what has unfolded, too: they are the next wave.
void CutSettler::apply_unfold(CutState& cut, NodeId node, std::span<const NodeId> children) {
    cut.apply_unfold(node, children);
    front_.set_unfolded(front_.slot_of(node), true);
    if (node != VertexTree::root() && !rules_.watches_ancestors) front_.remove(unchecked_links(tree_).parents[node]);
    candidates_.clear();
    for (const NodeId child : children)
        if (!tree_.is_leaf(child)) candidates_.push_back(rules_.tester->candidate(child));
    rules_.tester->find_still_rows(candidates_);
    for (const FoldCandidate& candidate : candidates_) {
        front_.insert(candidate, front_.slot_of(node));
        next_wave_.push_back(candidate.node);
    }
}

// Those of the next wave that unfold make the one after it.
void CutSettler::test_next_wave() {
    wave_slots_.clear();
    for (const NodeId node : next_wave_) wave_slots_.push_back(front_.slot_of(node)); // inserting may have moved them
    next_wave_.clear();
    test_slots(wave_slots_);
}

// What unfolds, and then what unfolds under it.
void CutSettler::unfold_wave(CutState& cut) {
    std::sort(wave_.begin(), wave_.end());
    next_wave_.clear();
    while (!wave_.empty()) {
        for (std::size_t i = 0; i < wave_.size(); ++i) {
            const NodeId node = wave_[i];
            if (i % changes_at_once == 0)
                prefetch_changes(cut, std::span(wave_).subspan(i, std::min(changes_at_once, wave_.size() - i)), false);
            if (front_.slot_of(node) == no_slot) continue; // an ancestor has folded
            apply_unfold(cut, node, cut.fetched_children(i % changes_at_once));
        }
        wave_.clear();
        test_next_wave();
    }
}

// ---- in time

bool CutSettler::waits(NodeId node) const {
    const Slot slot = front_.slot_of(node);
    return slot != no_slot && front_[slot].is_waiting;
}

// The wave waits for its turn, the worst first.
void CutSettler::let_wave_wait() {
    std::erase_if(wave_, [&](NodeId node) { return front_.slot_of(node) == no_slot; }); // an ancestor has folded
    costs_.resize(wave_.size());
    seen_costs_.resize(wave_.size());
    unfolds_.resize((wave_.size() + 63) / 64);
    if (waiting_.empty()) are_costs_of_view_ = true;
    if (!wave_.empty()) rules_.tester->find_costs(wave_, {costs_.data(), seen_costs_.data(), unfolds_.data()});
    for (std::size_t i = 0; i < wave_.size(); ++i) {
        front_.set_waiting(front_.slot_of(wave_[i]), true);
        const float cost = seen_costs_[i] >= 0 ? seen_costs_[i] : std::numeric_limits<float>::infinity();
        waiting_.push(cost, wave_[i]);
    }
    wave_.clear();
}

// Brings the worst waiting node to the top; false if none waits, or if a budget has no room for it.
bool CutSettler::find_worst(const CutState& cut, Index more) {
    while (!waiting_.empty() && !waits(waiting_.worst().node)) waiting_.pop();
    if (waiting_.empty()) return false;
    const auto first = unchecked_links(tree_).first_triangle;
    const NodeId node = waiting_.worst().node;
    return !rules_.triangle_budget ||
           std::uint64_t{cut.triangle_count()} + more + (first[node + 1] - first[node]) <= *rules_.triangle_budget;
}

void CutSettler::unfold_worst(CutState& cut) {
    Index triangles = 0;
    while (wave_.size() < unfolds_in_time && find_worst(cut, triangles)) {
        const NodeId node = waiting_.pop();
        front_.set_waiting(front_.slot_of(node), false);
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

float CutSettler::largest_cost_left(float threshold) const {
    if (!is_all_tested_ || !are_costs_of_view_) return std::numeric_limits<float>::infinity();
    return waiting_.empty() ? threshold : std::max(threshold, waiting_.worst().cost);
}

// ---- slots

bool CutSettler::has_unfolded_child(NodeId node, std::span<const std::uint64_t> unfolded) const {
    const auto subtree_end = unchecked_links(tree_).subtree_end;
    for (NodeId child = node + 1; child < subtree_end[node]; child = subtree_end[child])
        if ((unfolded[child >> 6] >> (child & 63)) & 1) return true;
    return false;
}

// A node's children are its neighbours.
CutSettler::Slot CutSettler::near_children_of(NodeId node) const {
    const auto subtree_end = unchecked_links(tree_).subtree_end;
    for (NodeId child = node + 1; child < subtree_end[node]; child = subtree_end[child])
        if (const Slot slot = front_.slot_of(child); slot != no_slot) return slot;
    return no_slot;
}

} // namespace unseen::vdtree
