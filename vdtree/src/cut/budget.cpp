#include "cut/budget.h"

#include <iterator>
#include <queue>

#include "cut/decide_tree.h"
#include "tree/needs.h"

namespace unseen::vdtree {

namespace {

// Nodes wait in buckets of a sixteenth of an octave of cost: floats that share their first twelve bits.
constexpr unsigned bucket_shift = 19;
constexpr std::size_t bucket_count = (0x7f800000u >> bucket_shift) + 1; // infinity's is the last

// The threshold is guessed from this many nodes of all trees together, which gives the number of triangles to a few
// percent.
constexpr std::size_t samples = 6144;
// A guess leaves room for this many of its standard deviations, and for a share besides.
constexpr double guess_deviations = 2.5, guess_share = 0.01;
// Decisions and costs are rounded differently: a dozen roundings of floats.
constexpr float decision_rounding = 1e-5f;
constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr float far_factor = 1.5f; // costs lower than the guess by this are hardly reached

struct Entry {
    float cost, seen_cost; // or what they are at most
    std::uint32_t tree;
    NodeId node;
};

// Whether `a` unfolds before `b`.
bool comes_first(const Entry& a, const Entry& b) {
    if (a.cost != b.cost) return a.cost > b.cost;
    return a.tree != b.tree ? a.tree < b.tree : a.node < b.node;
}

std::size_t bucket_of(float cost) { return std::bit_cast<std::uint32_t>(cost) >> bucket_shift; }

class Budgeter {
public:
    Budgeter(std::span<const CostSource* const> sources, const BudgetLimits& limits)
        : sources_(sources), limits_(limits), asked_(sources.size()), above_(sources.size()),
          has_bounds_(!limits.only_unfolding && std::ranges::all_of(sources, &CostSource::has_bounds)) {
        for (const CostSource* source : sources) {
            decision_.unfolded.emplace_back(words_for(source->tree.interior_count()));
            closers_.emplace_back(source->tree);
        }
        drawn_ = decision_.unfolded;
    }

    // From the roots down; the result of all ways.
    BudgetDecision run() {
        for (std::uint32_t number = 0; number < sources_.size(); ++number) {
            if (!tree(number).is_locked()) {
                ask(number, VertexTree::root(), infinity);
                continue;
            }
            const Entry root{infinity, infinity, number, VertexTree::root()};
            set_bit(decision_.unfolded[number], root.node);
            drawn_[number] = decision_.unfolded[number];
            closers_[number].close(drawn_[number], [](NodeId) {});
            triangles_ += tree(number).locked_triangles();
            ask_children({&root, 1});
        }
        answer([&](const Entry& entry) { buckets_[bucket_of(entry.cost)].push_back(entry); });
        return run_buckets();
    }

    // From a threshold that leaves some of the budget, and on from there. None where that turns out to be no way.
    std::optional<BudgetDecision> run_from_guess() {
        if (!has_bounds_ || limits_.is_out_of_time || !std::ranges::all_of(sources_, &CostSource::is_monotone))
            return std::nullopt;
        const float threshold = guess();
        if (!(threshold > 0) || !start_at(threshold)) return std::nullopt;
        BudgetDecision decision = run_buckets();
        // What unfolds at the threshold does so in the result only if that goes on beyond.
        if (!(decision.threshold < threshold * (1 - decision_rounding))) return std::nullopt;
        return decision;
    }

private:
    bool is_out_of_time() {
        if (limits_.is_out_of_time && limits_.is_out_of_time()) decision_.is_complete = false;
        return !decision_.is_complete;
    }
    const VertexTree& tree(std::uint32_t number) const { return sources_[number]->tree; }
    std::uint64_t triangles_of(const Entry& e) const { return unchecked_links(tree(e.tree)).triangles_of(e.node); }
    bool is_drawn(const Entry& e) const { return test_bit(drawn_[e.tree], e.node); }
    std::uint64_t more_triangles_of(const Entry& e) const { return is_drawn(e) ? 0 : triangles_of(e); }

    // Unfolds all of them, which show so many triangles more, and what they need; false, and does nothing, if that does
    // not fit.
    bool take(std::span<const Entry> entries, std::uint64_t more_triangles) {
        const std::uint64_t before = triangles_;
        triangles_ += more_triangles;
        drawn_before_.clear();
        drawn_for_them_.clear();
        for (const Entry& e : entries) {
            if (is_drawn(e)) drawn_before_.push_back(e);
            else set_bit(drawn_[e.tree], e.node);
        }
        for (const Entry& e : entries)
            closers_[e.tree].add_needs_of(e.node, drawn_[e.tree], [&](NodeId node) {
                drawn_for_them_.push_back({0, 0, e.tree, node});
                triangles_ += triangles_of(drawn_for_them_.back());
            });
        if (triangles_ <= limits_.triangles) {
            for (const Entry& e : entries) set_bit(decision_.unfolded[e.tree], e.node);
            return true;
        }
        triangles_ = before;
        for (const Entry& e : entries) clear_bit(drawn_[e.tree], e.node);
        for (const Entry& e : drawn_for_them_) clear_bit(drawn_[e.tree], e.node);
        for (const Entry& e : drawn_before_) set_bit(drawn_[e.tree], e.node);
        return false;
    }
    void leave(const Entry& e) {
        decision_.threshold = std::max(decision_.threshold, e.cost);
        decision_.max_seen_cost = std::max(decision_.max_seen_cost, e.seen_cost);
    }

    // ---- a guess

    // Nodes nest, so each unfolds whatever the others do: a sample tells how many unfold at a threshold.
    float guess() {
        std::size_t nodes = 0;
        for (const CostSource* source : sources_) nodes += source->tree.interior_count();
        const std::size_t stride = nodes / samples + 1;
        std::vector<std::pair<float, double>> found; // costs, and triangles that the node speaks for
        std::vector<NodeId> sample;
        for (std::uint32_t number = 0; number < sources_.size(); ++number) {
            sample.clear();
            for (std::size_t node = stride / 2; node < tree(number).interior_count(); node += stride)
                sample.push_back(static_cast<NodeId>(node));
            find_costs(number, sample);
            const auto& links = unchecked_links(tree(number));
            for (std::size_t i = 0; i < sample.size(); ++i)
                if (costs_[i] > 0)
                    found.emplace_back(costs_[i], static_cast<double>(stride * links.triangles_of(sample[i])));
        }
        std::make_heap(found.begin(), found.end()); // only the first of them are asked for
        double triangles = 0, variance = 0;
        for (auto end = found.end(); end != found.begin();) {
            std::pop_heap(found.begin(), end);
            const auto& [cost, more] = *--end;
            triangles += more;
            variance += more * more;
            if (triangles + guess_deviations * std::sqrt(variance) >
                (1 - guess_share) * static_cast<double>(limits_.triangles))
                return std::isfinite(cost) ? cost : 0;
        }
        return 0; // everything may fit
    }

    // Unfolds what the threshold says, if it fits; those that stay folded wait. Not where nodes are damaged.
    bool start_at(float threshold) {
        TreeDecider decider;
        bool is_damaged = false;
        far_bucket_ = bucket_of(threshold / far_factor);
        // A node that would unfold as an outline, but did not, is not an outline.
        const float unfolding = threshold * (1 + decision_rounding);
        for (std::uint32_t number = 0; number < sources_.size(); ++number) {
            const auto decide = [&](std::span<const NodeId> nodes, std::uint64_t* bits) {
                sources_[number]->decide_at(threshold, nodes, bits);
            };
            decision_.unfolded[number] = decider.run(tree(number), decide, [&](std::span<const NodeId> folded) {
                for (const NodeId node : folded) {
                    is_damaged |= !tree(number).is_sound(node);
                    ask(number, node, infinity);
                }
                find_bounds(number, &unfolding, [&](const Entry& entry) { wait(entry); });
            });
            const auto& links = unchecked_links(tree(number));
            drawn_[number] = decision_.unfolded[number];
            closers_[number].close(drawn_[number], [](NodeId) {});
            for_each_bit(drawn_[number], [&](NodeId node) { triangles_ += links.triangles_of(node); });
        }
        decision_.node_tests += decider.decisions;
        return !is_damaged && triangles_ <= limits_.triangles;
    }

    // ---- costs

    // Nodes are asked about one by one and answered in batches.
    void ask(std::uint32_t tree, NodeId node, float parents_cost) {
        asked_[tree].push_back(node);
        above_[tree].push_back(parents_cost);
    }
    void ask_children(std::span<const Entry> entries) {
        for (std::size_t first = 0; first < entries.size();) { // nearly always of one tree
            std::size_t end = first + 1;
            while (end < entries.size() && entries[end].tree == entries[first].tree) ++end;
            const auto of_tree = entries.subspan(first, end - first);
            const std::uint32_t number = of_tree.front().tree;
            walk_children(
                tree(number), of_tree.size(), [&](std::size_t i) { return of_tree[i].node; },
                [&](std::size_t i, NodeId child) { ask(number, child, of_tree[i].cost); });
            first = end;
        }
    }
    void find_costs(std::uint32_t tree, std::span<const NodeId> nodes) {
        costs_.resize(nodes.size());
        seen_costs_.resize(nodes.size());
        unfolded_.resize(words_for(nodes.size()));
        if (nodes.empty()) return;
        sources_[tree]->find_costs(nodes, {costs_.data(), seen_costs_.data(), unfolded_.data()});
        decision_.node_tests += nodes.size();
    }
    Entry entry_of(std::uint32_t tree, std::size_t i) const {
        const float cost = costs_[i] >= 0 ? costs_[i] : infinity;
        return {std::min(cost, above_[tree][i]), seen_costs_[i], tree, asked_[tree][i]};
    }
    void forget_asked(std::uint32_t tree) {
        asked_[tree].clear();
        above_[tree].clear();
    }
    // Entries with their costs; those that must stay folded are left.
    template <class F>
    void answer(F&& f) {
        for (std::uint32_t number = 0; number < sources_.size(); ++number) {
            find_costs(number, asked_[number]);
            for (std::size_t i = 0; i < asked_[number].size(); ++i) {
                const Entry entry = entry_of(number, i);
                const bool wanted = limits_.only_unfolding ? test_bit(unfolded_, i) : entry.cost > 0 || limits_.fill;
                if (wanted && tree(number).is_sound(entry.node)) f(entry);
                else leave(entry);
            }
            forget_asked(number);
        }
    }
    // Waits with what its costs are at most.
    void wait(const Entry& entry) {
        const std::size_t bucket = bucket_of(entry.cost);
        (bucket < far_bucket_ ? far_ : bounded_[bucket]).push_back(entry);
    }
    // Entries with what their costs are at most; those of folded ones, where a threshold is given at which all that
    // were asked for are.
    template <class F>
    void find_bounds(std::uint32_t tree, const float* folded_at, F&& f) {
        const auto& nodes = asked_[tree];
        if (nodes.empty()) return;
        costs_.resize(nodes.size());
        seen_costs_.resize(nodes.size());
        sources_[tree]->find_cost_bounds(nodes, folded_at, costs_.data(), seen_costs_.data());
        decision_.node_tests += nodes.size();
        for (std::size_t i = 0; i < nodes.size(); ++i) f(entry_of(tree, i));
        forget_asked(tree);
    }
    // The costs of what has bounds. (The bound is at most the parent's cost.)
    template <class F>
    void resolve(std::span<const Entry> bounded, F&& f) {
        for (const Entry& entry : bounded) ask(entry.tree, entry.node, entry.cost);
        answer(f);
    }
    // The costs of what is asked, as far as they may lie in the bucket: f(entry); or g(entry), with what they are at
    // most.
    template <class F, class G>
    void answer(std::size_t bucket, F&& f, G&& g) {
        if (!has_bounds_) return answer(f);
        near_.clear();
        for (std::uint32_t tree = 0; tree < sources_.size(); ++tree)
            find_bounds(tree, nullptr, [&](const Entry& entry) {
                if (bucket_of(entry.cost) == bucket) near_.push_back(entry);
                else g(entry);
            });
        resolve(near_, f);
    }

    // ---- buckets

    BudgetDecision run_buckets() {
        std::size_t bucket = bucket_count;
        while (bucket-- > 0) {
            if (bucket + 1 == far_bucket_) {
                far_bucket_ = 0;
                for (const Entry& entry : std::exchange(far_, {})) wait(entry);
            }
            if (buckets_[bucket].empty() && bounded_[bucket].empty()) continue;
            if (is_out_of_time()) break;
            const std::vector<Entry> bounded = std::move(bounded_[bucket]);
            bounded_[bucket].clear();
            resolve(bounded, [&](const Entry& entry) { buckets_[bucket_of(entry.cost)].push_back(entry); });
            if (!take_bucket(bucket)) break;
        }
        for (const auto& left : buckets_)
            for (const Entry& entry : left) leave(entry);
        left_.insert(left_.end(), far_.begin(), far_.end());
        for (const auto& left : bounded_) left_.insert(left_.end(), left.begin(), left.end());
        leave_bounded();
        return std::move(decision_);
    }

    // Asks only for the costs of those that may have the largest of either.
    void leave_bounded() {
        constexpr std::size_t at_once = 256;
        for (bool by_seen_cost = false;; by_seen_cost = true) {
            const auto larger = [&](const Entry& a, const Entry& b) {
                return by_seen_cost ? a.seen_cost > b.seen_cost : a.cost > b.cost;
            };
            std::erase_if(left_, [&](const Entry& e) {
                return e.cost <= decision_.threshold && e.seen_cost <= decision_.max_seen_cost;
            });
            if (left_.empty()) return;
            const std::size_t count = std::min(at_once, left_.size());
            const auto end = left_.begin() + static_cast<std::ptrdiff_t>(count);
            std::nth_element(left_.begin(), end - 1, left_.end(), larger);
            resolve(std::span(left_).first(count), [&](const Entry& entry) { leave(entry); });
            left_.erase(left_.begin(), end);
        }
    }

    // Unfolds a whole bucket with everything under it that belongs to it, or, where the budget ends in it, in order
    // until one does not fit; then returns false.
    bool take_bucket(std::size_t bucket) {
        const std::vector<Entry> waiting = std::move(buckets_[bucket]);
        buckets_[bucket].clear();
        // Costs that are all the same may make a bucket as large as the tree; then one by one.
        const std::size_t most = 4 * waiting.size() + 4096;
        std::vector<Entry> all, fresh = waiting, below, bounded_below;
        std::uint64_t sum = triangles_;
        while (!fresh.empty()) {
            constexpr std::size_t ahead = 16; // entries between a prefetch and its use
            for (std::size_t i = 0; i < fresh.size(); ++i) {
                if (i + ahead < fresh.size())
                    prefetch(&unchecked_links(tree(fresh[i + ahead].tree)).first_triangle[fresh[i + ahead].node]);
                sum += more_triangles_of(fresh[i]);
            }
            all.insert(all.end(), fresh.begin(), fresh.end());
            if (sum > limits_.triangles && all.size() > most) {
                finish_one_by_one(waiting);
                return false;
            }
            ask_children(fresh);
            fresh.clear();
            answer(
                bucket, [&](const Entry& entry) { (bucket_of(entry.cost) == bucket ? fresh : below).push_back(entry); },
                [&](const Entry& entry) { bounded_below.push_back(entry); });
        }
        if (sum > limits_.triangles || !take(all, sum - triangles_)) {
            finish(std::move(all), below, bounded_below);
            return false;
        }
        for (const Entry& entry : below) buckets_[bucket_of(entry.cost)].push_back(entry);
        for (const Entry& entry : bounded_below) wait(entry);
        return true;
    }

    void finish(std::vector<Entry> all, std::span<const Entry> below, std::span<const Entry> bounded_below) {
        std::sort(all.begin(), all.end(), comes_first);
        std::size_t i = 0;
        while (i < all.size() && take({&all[i], 1}, more_triangles_of(all[i]))) ++i;
        // What is left is folded, as far as its parent is not.
        const auto is_folded_under_unfolded = [&](const Entry& e) {
            const NodeId parent = unchecked_links(tree(e.tree)).parents[e.node];
            return parent == no_node || test_bit(decision_.unfolded[e.tree], parent);
        };
        for (; i < all.size(); ++i)
            if (is_folded_under_unfolded(all[i])) leave(all[i]);
        for (const Entry& entry : below)
            if (is_folded_under_unfolded(entry)) leave(entry);
        std::ranges::copy_if(bounded_below, std::back_inserter(left_), is_folded_under_unfolded);
    }

    void finish_one_by_one(std::vector<Entry> waiting) {
        const auto comes_later = [](const Entry& a, const Entry& b) { return comes_first(b, a); };
        std::priority_queue queue(comes_later, std::move(waiting));
        while (!queue.empty()) {
            const Entry entry = queue.top();
            if (!take({&entry, 1}, more_triangles_of(entry))) break;
            queue.pop();
            ask_children({&entry, 1});
            answer([&](const Entry& child) { queue.push(child); });
        }
        for (; !queue.empty(); queue.pop()) leave(queue.top());
    }

    std::span<const CostSource* const> sources_;
    const BudgetLimits& limits_;
    std::uint64_t triangles_ = 0; // of what is drawn
    std::vector<NeedCloser> closers_;
    std::vector<std::vector<std::uint64_t>> drawn_;    // what is unfolded, and what that needs
    std::vector<Entry> drawn_before_, drawn_for_them_; // scratch
    std::vector<std::vector<Entry>> buckets_{bucket_count};
    std::vector<std::vector<Entry>> bounded_{bucket_count}; // of which only bounds are known yet
    std::size_t far_bucket_ = 0;
    std::vector<Entry> far_; // what has a bound below this bucket, which may never be reached
    std::vector<Entry> near_, left_;
    std::vector<std::vector<NodeId>> asked_;
    std::vector<std::vector<float>> above_;
    bool has_bounds_;
    std::vector<float> costs_, seen_costs_;
    std::vector<std::uint64_t> unfolded_;
    BudgetDecision decision_;
};

} // namespace

BudgetDecision decide_budget(std::span<const CostSource* const> sources, const BudgetLimits& given) {
    BudgetLimits limits = given;
    std::uint64_t locked = 0; // is there in any cut
    for (const CostSource* source : sources) locked += source->tree.locked_triangles();
    limits.triangles = std::max(limits.triangles, locked);
    if (auto decision = Budgeter(sources, limits).run_from_guess()) return std::move(*decision);
    return Budgeter(sources, limits).run();
}

} // namespace unseen::vdtree
