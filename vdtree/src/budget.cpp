#include "budget.h"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <queue>

#include "prefetch.h"
#include "walk_children.h"

namespace unseen::vdtree {

namespace {

// Nodes wait in buckets of an eighth of an octave of cost: floats that share their first eleven bits.
constexpr unsigned bucket_shift = 20;
constexpr std::size_t bucket_count = (0x7f800000u >> bucket_shift) + 1; // infinity's is the last

struct Entry {
    float cost, seen_cost;
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
    Budgeter(std::span<const VertexTree* const> trees, std::span<const FoldTester* const> testers, const BudgetLimits& limits)
        : trees_(trees), testers_(testers), limits_(limits), asked_(trees.size()), above_(trees.size()) {
        for (const VertexTree* tree : trees) decision_.unfolded.emplace_back((std::size_t{tree->interior_count()} + 63) / 64);
    }

    BudgetDecision run() {
        for (std::uint32_t tree = 0; tree < trees_.size(); ++tree) ask(tree, VertexTree::root(), std::numeric_limits<float>::infinity());
        answer([&](const Entry& entry) { buckets_[bucket_of(entry.cost)].push_back(entry); });
        std::size_t bucket = bucket_count;
        while (bucket-- > 0)
            if (!buckets_[bucket].empty() && (is_out_of_time() || !take_bucket(bucket))) break;
        for (const auto& left : buckets_)
            for (const Entry& entry : left) leave(entry);
        return std::move(decision_);
    }

private:
    bool is_out_of_time() {
        if (limits_.is_out_of_time && limits_.is_out_of_time()) decision_.is_complete = false;
        return !decision_.is_complete;
    }
    std::uint64_t triangles_of(const Entry& e) const {
        const auto first = trees_[e.tree]->first_triangle();
        return first[e.node + 1] - first[e.node];
    }
    void take(const Entry& e) { decision_.unfolded[e.tree][e.node >> 6] |= std::uint64_t{1} << (e.node & 63); }
    void leave(const Entry& e) {
        decision_.threshold = std::max(decision_.threshold, e.cost);
        decision_.max_seen_cost = std::max(decision_.max_seen_cost, e.seen_cost);
    }

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
            const std::uint32_t tree = of_tree.front().tree;
            walk_children(*trees_[tree], of_tree.size(), [&](std::size_t i) { return of_tree[i].node; },
                          [&](std::size_t i, NodeId child) { ask(tree, child, of_tree[i].cost); });
            first = end;
        }
    }
    template <class F>
    void answer(F&& f) {
        for (std::uint32_t tree = 0; tree < trees_.size(); ++tree) {
            auto& nodes = asked_[tree];
            costs_.resize(nodes.size());
            seen_costs_.resize(nodes.size());
            unfolded_.resize((nodes.size() + 63) / 64);
            testers_[tree]->find_costs(nodes, {costs_.data(), seen_costs_.data(), unfolded_.data()});
            decision_.node_tests += nodes.size();
            for (std::size_t i = 0; i < nodes.size(); ++i) {
                const float cost = costs_[i] >= 0 ? costs_[i] : std::numeric_limits<float>::infinity();
                const Entry entry{std::min(cost, above_[tree][i]), seen_costs_[i], tree, nodes[i]};
                const bool wanted = limits_.only_unfolding ? (unfolded_[i / 64] >> (i % 64)) & 1 : entry.cost > 0 || limits_.fill;
                if (wanted && trees_[tree]->is_sound(nodes[i])) f(entry);
                else leave(entry);
            }
            nodes.clear();
            above_[tree].clear();
        }
    }

    // Unfolds a whole bucket with everything under it that belongs to it, or, where the budget ends in it, in order until one does
    // not fit; then returns false.
    bool take_bucket(std::size_t bucket) {
        const std::vector<Entry> waiting = std::move(buckets_[bucket]);
        buckets_[bucket].clear();
        // Costs that are all the same may make a bucket as large as the tree; then one by one.
        const std::size_t most = 4 * waiting.size() + 4096;
        std::vector<Entry> all, fresh = waiting, below;
        std::uint64_t sum = triangles_;
        while (!fresh.empty()) {
            constexpr std::size_t ahead = 16; // entries between a prefetch and its use
            for (std::size_t i = 0; i < fresh.size(); ++i) {
                if (i + ahead < fresh.size()) prefetch(&trees_[fresh[i + ahead].tree]->first_triangle()[fresh[i + ahead].node]);
                sum += triangles_of(fresh[i]);
            }
            all.insert(all.end(), fresh.begin(), fresh.end());
            if (sum > limits_.triangles && all.size() > most) {
                finish_one_by_one(waiting);
                return false;
            }
            ask_children(fresh);
            fresh.clear();
            answer([&](const Entry& entry) { (bucket_of(entry.cost) == bucket ? fresh : below).push_back(entry); });
        }
        if (sum > limits_.triangles) {
            finish(std::move(all), below);
            return false;
        }
        triangles_ = sum;
        for (const Entry& entry : all) take(entry);
        for (const Entry& entry : below) buckets_[bucket_of(entry.cost)].push_back(entry);
        return true;
    }

    void finish(std::vector<Entry> all, std::span<const Entry> below) {
        std::sort(all.begin(), all.end(), comes_first);
        std::size_t i = 0;
        for (; i < all.size(); ++i) {
            const std::uint64_t sum = triangles_ + triangles_of(all[i]);
            if (sum > limits_.triangles) break;
            triangles_ = sum;
            take(all[i]);
        }
        // What is left is folded, as far as its parent is not.
        const auto is_folded_under_unfolded = [&](const Entry& e) {
            const NodeId parent = trees_[e.tree]->parents()[e.node];
            const auto& bits = decision_.unfolded[e.tree];
            return parent == no_node || ((bits[parent >> 6] >> (parent & 63)) & 1);
        };
        for (; i < all.size(); ++i)
            if (is_folded_under_unfolded(all[i])) leave(all[i]);
        for (const Entry& entry : below)
            if (is_folded_under_unfolded(entry)) leave(entry);
    }

    void finish_one_by_one(std::vector<Entry> waiting) {
        const auto comes_later = [](const Entry& a, const Entry& b) { return comes_first(b, a); };
        std::priority_queue queue(comes_later, std::move(waiting));
        while (!queue.empty() && triangles_ + triangles_of(queue.top()) <= limits_.triangles) {
            const Entry entry = queue.top();
            queue.pop();
            triangles_ += triangles_of(entry);
            take(entry);
            ask_children({&entry, 1});
            answer([&](const Entry& child) { queue.push(child); });
        }
        for (; !queue.empty(); queue.pop()) leave(queue.top());
    }

    std::span<const VertexTree* const> trees_;
    std::span<const FoldTester* const> testers_;
    const BudgetLimits& limits_;
    std::uint64_t triangles_ = 0;
    std::array<std::vector<Entry>, bucket_count> buckets_;
    std::vector<std::vector<NodeId>> asked_;
    std::vector<std::vector<float>> above_;
    std::vector<float> costs_, seen_costs_;
    std::vector<std::uint64_t> unfolded_;
    BudgetDecision decision_;
};

} // namespace

BudgetDecision decide_budget(std::span<const VertexTree* const> trees, std::span<const FoldTester* const> testers,
                             const BudgetLimits& limits) {
    return Budgeter(trees, testers, limits).run();
}

} // namespace unseen::vdtree
