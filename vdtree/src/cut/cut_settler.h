// Settles a cut: tests the nodes that are due, and folds and unfolds what follows, until every verdict is obeyed.
#pragma once

#include <chrono>
#include <functional>
#include <iterator>
#include <optional>
#include <utility>

#include "cut/cut_front.h"
#include "cut/cut_state.h"

namespace unseen::vdtree {

// Watched (in the front) is what can change next: the folded nodes under unfolded ones (or the root), and the unfolded
// nodes that have no unfolded child. Settling tests those that are due, and changes what they say; its cost goes with the
// motion and the active triangles, not with the mesh. Other unfolded nodes stay so while one of their children does, for
// criteria are monotone; where a child's verdict stands by less than the rounding of tests, the parent is tested too.
// Under a criterion that is not monotone all unfolded nodes are watched. So the cut does not depend on the way to it.
class CutSettler {
public:
    explicit CutSettler(const VertexTree& tree) : tree_(tree), front_(tree.interior_count()) {}

    // What nodes are tested by; for one call.
    struct Rules {
        FoldTester* tester = nullptr; // looks from the viewpoint; its threshold is set here
        float threshold = 1;
        float keeping = 1; // hysteresis: what is unfolded stays so down to the threshold over this
        std::optional<Index> triangle_budget;
        bool watches_ancestors = false; // the criterion is not monotone
        std::optional<std::chrono::steady_clock::time_point> time_limit;
        // Clocks that have run so far are restarted, so that deadlines in floats stay fine enough.
        double longest_run = 1;
    };

    CutFront& front() noexcept { return front_; }
    void watch_nothing() {
        front_.clear();
        waiting_.clear();
        are_costs_of_view_ = is_all_tested_ = true;
        next_due_ = 0;
    }

    // What can change next, from a cut of which nothing is watched: due now, or tested, with deadlines, and settled.
    void watch_all(const CutState& cut, const Rules& rules) {
        rules_ = rules;
        watch_border(cut, false);
    }
    void watch_and_settle(CutState& cut, const Rules& rules) {
        rules_ = rules;
        begin_settling();
        watch_border(cut, true);
        end_settling(cut);
    }

    // Within the cut's changes in steps. `due`: of the front's collect_due().
    // Tests what is due, folds what has to go, and unfolds what has to come, with all that follows above and under it.
    void settle(CutState& cut, const Rules& rules, std::span<const CutFront::Slot> due) {
        rules_ = rules;
        begin_settling();
        constexpr std::size_t piece = 2048; // what their tests read and write stays in the cache
        for (std::size_t first = 0; first < due.size(); first += piece)
            test_due(due.subspan(first, std::min(piece, due.size() - first)));
        end_settling(cut);
    }

    // In small steps, as many as the time is enough for, the worst folds first: at least one of tests and folds, and one of
    // unfolds. Both get the same time, for what is not tested keeps what is unfolded from being right, and unfolds alone
    // make the cut better. What is left to do is kept.
    void settle_in_time(CutState& cut, const Rules& rules) {
        rules_ = rules;
        using Clock = std::chrono::steady_clock;
        begin_settling();
        if (waiting_.size() > front_.size()) {
            std::erase_if(waiting_, [&](const Waiting& waiting) { return !waits(waiting.node); });
            std::make_heap(waiting_.begin(), waiting_.end());
        }
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

    bool is_all_tested() const noexcept { return is_all_tested_; }
    bool has_waiting() const noexcept { return !waiting_.empty(); }
    // Nodes wait with their costs as of a view: these hold on while it stands still.
    void keep_costs_if(bool is_still) noexcept {
        are_costs_of_view_ = waiting_.empty() || (are_costs_of_view_ && is_still);
    }
    // No more than this costs any node that is folded, if the view is that of the last tests: the threshold, or what
    // waits.
    float largest_cost_left(float threshold) const {
        if (!is_all_tested_ || !are_costs_of_view_) return never_due;
        return waiting_.empty() ? threshold : std::max(threshold, waiting_.front().cost);
    }

    std::uint64_t take_node_tests() noexcept { return std::exchange(node_tests_, 0); } // since this was last asked
    std::uint64_t byte_size() const noexcept { return front_.byte_size() + sizeof(Waiting) * waiting_.capacity(); }

private:
    static constexpr std::size_t piece_tests =
        512; // tests at once while slots are filled: what they read stays in the cache
    // The data of this many changes is prefetched: some two thousand cache lines, of which the second-level cache holds several
    // times as many.
    static constexpr std::size_t changes_at_once = 64;
    // Blocks whose due nodes are tested, with what folds for it, between two looks at the clock: some microseconds.
    static constexpr std::size_t blocks_at_once = 16;
    static constexpr std::size_t unfolds_in_time = 16; // likewise

    using Slot = CutFront::Slot;
    static constexpr Slot no_slot = CutFront::no_slot;

    void watch_border(const CutState& cut, bool tests) {
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
                candidates_.back().is_unfolded = cut.is_wanted(piece[i]);
            }
            rules_.tester->find_still_rows(candidates_);
            wave_slots_.clear();
            for (const FoldCandidate& candidate : candidates_) wave_slots_.push_back(front_.append(candidate));
            front_.end_append();
            if (tests) test_slots(wave_slots_);
            else
                for (const Slot slot : wave_slots_) front_.set_deadlines(slot, Verdict{});
        }
    }

    // The nodes to watch, in about their order, as the next wave.
    void find_border(const CutState& cut) {
        unfolding_.clear();
        for_each_bit(cut.wanted(), [&](NodeId node) { unfolding_.push_back(node); });
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
                if (cut.is_wanted(child)) is_border = false;
                else next_wave_.push_back(child);
            });
        go_to(unfolding_.size());
    }

    void begin_settling() {
        folding_.clear();
        parents_.clear();
        wave_.clear();
    }

    void finish_folding(CutState& cut) {
        while (!folding_.empty() || !parents_.empty()) {
            fold_wave(cut);
            test_parents(cut);
        }
    }

    void end_settling(CutState& cut) {
        finish_folding(cut);
        for (const Waiting& waiting : waiting_) { // of calls with a time limit
            if (!waits(waiting.node)) continue;
            front_.set_waiting(front_.slot_of(waiting.node), false);
            wave_.push_back(waiting.node);
        }
        waiting_.clear();
        is_all_tested_ = true;
        unfold_wave(cut);
        front_.restart_clocks(rules_.longest_run);
    }

    // ---- tests

    void test_due(std::span<const Slot> slots) {
        if (rules_.keeping == 1) {
            test_slots(slots);
            return;
        }
        for (const bool unfolded : {true, false}) {
            kept_.clear();
            std::ranges::copy_if(slots, std::back_inserter(kept_),
                                 [&](Slot slot) { return front_[slot].is_unfolded == unfolded; });
            use_threshold_of(unfolded);
            test_slots(kept_);
        }
    }

    void test_slots(std::span<const Slot> slots) {
        node_tests_ += slots.size();
        TestBatch tested{};
        for (std::size_t first = 0; first < slots.size(); first += kernel_lanes) {
            const auto batch = slots.subspan(first, std::min(kernel_lanes, slots.size() - first));
            rules_.tester->test(front_.candidates(), slots, first, tested);
            front_.set_deadlines(batch, tested);
            for (std::size_t i = 0; i < batch.size(); ++i) {
                const FoldCandidate& candidate = front_[batch[i]];
                const bool unfolds = (tested.unfolded >> i) & 1, is_close = front_.is_within_rounding(tested[i]);
                // Mostly nothing changes. What was folded or unfolded before is unpredictable, so branch-free.
                if (!(candidate.is_waiting | (candidate.is_unfolded != unfolds) | (unfolds & is_close))) continue;
                if (candidate.is_waiting) {
                    if (!unfolds) front_.set_waiting(batch[i], false);
                } else if (candidate.is_unfolded && !unfolds) folding_.push_back(candidate.node);
                else if (candidate.is_unfolded && is_close) ask_parent(candidate.node);
                else if (unfolds && !candidate.is_unfolded && tree_.is_sound(candidate.node))
                    wave_.push_back(candidate.node);
            }
        }
    }

    void ask_parent(NodeId node) {
        if (node != VertexTree::root() && !rules_.watches_ancestors)
            parents_.push_back(unchecked_links(tree_).parents[node]);
    }
    // Nodes that are watched are left to their deadlines.
    void test_parents(const CutState& cut) {
        std::sort(parents_.begin(), parents_.end());
        parents_.erase(std::unique(parents_.begin(), parents_.end()), parents_.end());
        std::erase_if(parents_, [&](NodeId node) { return !cut.is_wanted(node) || front_.slot_of(node) != no_slot; });
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
            if (!verdicts_[i].unfolded || !has_unfolded_child(node, cut))
                front_.set_deadlines(front_.insert(candidates_[i], near_children_of(node)), verdicts_[i]);
            if (!verdicts_[i].unfolded) folding_.push_back(node);
            else if (front_.is_within_rounding(verdicts_[i])) ask_parent(node);
        }
        use_threshold_of(false);
    }

    // With hysteresis, what is unfolded stays so down to a somewhat lower cost.
    void use_threshold_of(bool unfolded) {
        if (rules_.keeping > 1)
            rules_.tester->set_threshold(unfolded ? rules_.threshold / rules_.keeping : rules_.threshold);
    }

    // ---- changes

    // What this class itself will read and write, too.
    void prefetch_changes(CutState& cut, std::span<const NodeId> nodes, bool folds) {
        for (const NodeId node : nodes) {
            front_.prefetch_slot(node);
            prefetch(&unchecked_links(tree_).parents[node]);
        }
        cut.prefetch_changes(nodes, folds);
        for (const NodeId node : nodes) {
            front_.prefetch_deadlines(node);
            if (const NodeId parent = unchecked_links(tree_).parents[node]; parent != no_node)
                front_.prefetch_slot(parent);
        }
        for (const NodeId child : cut.fetched_children()) {
            if (tree_.is_place(child)) continue;
            front_.prefetch_slot(child);
            if (!folds) rules_.tester->prefetch(child);
        }
        if (folds) {
            for (const NodeId child : cut.fetched_children())
                if (!tree_.is_place(child)) front_.prefetch_deadlines(child);
        } else {
            for (const NodeId node : nodes)
                if (const NodeId parent = unchecked_links(tree_).parents[node]; parent != no_node)
                    front_.prefetch_deadlines(parent);
        }
    }

    // Folds with all that is under it what the last tests want folded, the lowest nodes first; what is above may want to
    // fold now.
    void fold_wave(CutState& cut) {
        std::sort(folding_.begin(), folding_.end(), std::greater<>());
        const auto subtree_end = unchecked_links(tree_).subtree_end;
        for (std::size_t i = 0; i < folding_.size(); ++i) {
            if (i % changes_at_once == 0)
                prefetch_changes(cut, std::span(folding_).subspan(i, std::min(changes_at_once, folding_.size() - i)),
                                 true);
            const NodeId node = folding_[i];
            if (!cut.is_wanted(node)) continue;
            const auto children = cut.fetched_children(i % changes_at_once);
            const auto has_fold = [&](NodeId child) { return !tree_.is_place(child) && cut.is_wanted(child); };
            if (std::ranges::none_of(children, has_fold)) { // nearly always
                cut.want_fold(node, children);
                for (const NodeId child : children)
                    if (!tree_.is_place(child)) front_.remove(child);
            } else {
                cut.want_fold_below(node, [&](NodeId folded) {
                    for (NodeId child = folded + 1; child < subtree_end[folded]; child = subtree_end[child])
                        front_.remove(child);
                });
            }
            front_.set_unfolded(front_.slot_of(node), false);
            ask_parent(node);
        }
        folding_.clear();
    }

    // What unfolds, and then what unfolds under it.
    void unfold_wave(CutState& cut) {
        std::sort(wave_.begin(), wave_.end());
        next_wave_.clear();
        while (!wave_.empty()) {
            for (std::size_t i = 0; i < wave_.size(); ++i) {
                const NodeId node = wave_[i];
                if (i % changes_at_once == 0)
                    prefetch_changes(cut, std::span(wave_).subspan(i, std::min(changes_at_once, wave_.size() - i)),
                                     false);
                if (front_.slot_of(node) == no_slot) continue; // an ancestor has folded
                apply_unfold(cut, node, cut.fetched_children(i % changes_at_once));
            }
            wave_.clear();
            test_next_wave();
        }
    }

    // Watches the children of what has unfolded, too: they are the next wave.
    void apply_unfold(CutState& cut, NodeId node, std::span<const NodeId> children) {
        cut.want_unfold(node, children);
        front_.set_unfolded(front_.slot_of(node), true);
        if (node != VertexTree::root() && !rules_.watches_ancestors)
            front_.remove(unchecked_links(tree_).parents[node]);
        candidates_.clear();
        for (const NodeId child : children)
            if (!tree_.is_place(child)) candidates_.push_back(rules_.tester->candidate(child));
        rules_.tester->find_still_rows(candidates_);
        for (const FoldCandidate& candidate : candidates_) {
            front_.insert(candidate, front_.slot_of(node));
            next_wave_.push_back(candidate.node);
        }
    }

    // Those of the next wave that unfold make the one after it.
    void test_next_wave() {
        wave_slots_.clear();
        for (const NodeId node : next_wave_)
            wave_slots_.push_back(front_.slot_of(node)); // inserting may have moved them
        next_wave_.clear();
        test_slots(wave_slots_);
    }

    // ---- in time

    bool waits(NodeId node) const {
        const Slot slot = front_.slot_of(node);
        return slot != no_slot && front_[slot].is_waiting;
    }
    void pop_waiting() {
        std::pop_heap(waiting_.begin(), waiting_.end());
        waiting_.pop_back();
    }
    // The wave waits for its turn, the worst first.
    void let_wave_wait() {
        std::erase_if(wave_, [&](NodeId node) { return front_.slot_of(node) == no_slot; }); // an ancestor has folded
        costs_.resize(wave_.size());
        seen_costs_.resize(wave_.size());
        unfolds_.resize(words_for(wave_.size()));
        if (waiting_.empty()) are_costs_of_view_ = true;
        if (!wave_.empty()) rules_.tester->find_costs(wave_, {costs_.data(), seen_costs_.data(), unfolds_.data()});
        for (std::size_t i = 0; i < wave_.size(); ++i) {
            front_.set_waiting(front_.slot_of(wave_[i]), true);
            waiting_.push_back({seen_costs_[i] >= 0 ? seen_costs_[i] : never_due, wave_[i]});
            std::push_heap(waiting_.begin(), waiting_.end());
        }
        wave_.clear();
    }

    // Brings the worst waiting node to the top; false if none waits, or if a budget has no room for it.
    bool find_worst(const CutState& cut, Index more = 0) {
        while (!waiting_.empty() && !waits(waiting_.front().node)) pop_waiting();
        if (waiting_.empty()) return false;
        return !rules_.triangle_budget || std::uint64_t{cut.triangle_count()} + more +
                                                  unchecked_links(tree_).triangles_of(waiting_.front().node) <=
                                              *rules_.triangle_budget;
    }

    void unfold_worst(CutState& cut) {
        Index triangles = 0;
        while (wave_.size() < unfolds_in_time && find_worst(cut, triangles)) {
            const NodeId node = waiting_.front().node;
            pop_waiting();
            front_.set_waiting(front_.slot_of(node), false);
            triangles += unchecked_links(tree_).triangles_of(node);
            wave_.push_back(node);
        }
        prefetch_changes(cut, wave_, false);
        next_wave_.clear();
        for (std::size_t i = 0; i < wave_.size(); ++i) apply_unfold(cut, wave_[i], cut.fetched_children(i));
        wave_.clear();
        test_next_wave();
        let_wave_wait();
    }

    bool has_unfolded_child(NodeId node, const CutState& cut) const {
        const auto subtree_end = unchecked_links(tree_).subtree_end;
        for (NodeId child = node + 1; child < subtree_end[node]; child = subtree_end[child])
            if (cut.is_wanted(child)) return true;
        return false;
    }

    // A node's children are its neighbours.
    Slot near_children_of(NodeId node) const {
        const auto subtree_end = unchecked_links(tree_).subtree_end;
        for (NodeId child = node + 1; child < subtree_end[node]; child = subtree_end[child])
            if (const Slot slot = front_.slot_of(child); slot != no_slot) return slot;
        return no_slot;
    }

    const VertexTree& tree_;
    Rules rules_; // of this call
    CutFront front_;
    std::uint64_t node_tests_ = 0;

    // For calls with a time limit. A heap of what is to be unfolded, the worst first: by cost, ties by node number. Whether
    // a node still waits, its mark in the front says; entries without it are left over, and are dropped at the top.
    struct Waiting {
        float cost;
        NodeId node;
        bool operator<(const Waiting& other) const {
            return cost != other.cost ? cost < other.cost : node > other.node;
        }
    };
    std::vector<Waiting> waiting_;
    bool are_costs_of_view_ = true;  // those of waiting_, or from a viewpoint before
    bool is_all_tested_ = true;      // that was due
    CutFront::BlockId next_due_ = 0; // where to look on

    // Scratch. A wave is what changes together: its nodes do not lie under each other.
    std::vector<NodeId> wave_, next_wave_, unfolding_, folding_, parents_;
    std::vector<Slot> kept_, wave_slots_;
    std::vector<FoldCandidate> candidates_;
    std::vector<Verdict> verdicts_;
    std::vector<float> costs_, seen_costs_;
    std::vector<std::uint64_t> unfolds_;
};

} // namespace unseen::vdtree
