// What nodes of a cut need so that no triangle is turned over: see NeedArrays in <unseen/vdtree/vertex_tree.h>.
#pragma once

#include <vector>

#include <unseen/vdtree/internal/node_bits.h>

#include "tree/unchecked_links.h"

namespace unseen::vdtree {

// Calls f(need) for what the nodes of a set need. The tree must have some that need others.
template <class Links, class F>
void for_each_need(const Links& links, std::span<const std::uint64_t> set, F&& f) {
    for (std::size_t word = 0; word < 2 * set.size() && word < links.needing.size(); ++word) {
        const auto unfolded = static_cast<std::uint32_t>(set[word / 2] >> (32 * (word % 2)));
        const RankWord& needing = links.needing[word];
        if ((needing.bits & unfolded) == 0) continue;
        const auto of_nodes = [&](Index first, Index end) {
            for (Index i = links.first_need[first]; i < links.first_need[end]; ++i) f(links.needs[i]);
        };
        // Mostly all of them.
        if ((needing.bits & ~unfolded) == 0) {
            of_nodes(needing.before, needing.before + count_bits(needing.bits));
            continue;
        }
        for (std::uint32_t bits = needing.bits & unfolded; bits; bits &= bits - 1) {
            const Index k = needing.before + count_bits(needing.bits & ((bits & -bits) - 1));
            of_nodes(k, k + 1);
        }
    }
}

// What follows from a set of unfolded nodes: the least set around it in which every node has what it needs. So the result
// depends on the set alone, and grows with it. Damaged nodes stay out, and all that is under them.
class NeedCloser {
public:
    explicit NeedCloser(const VertexTree& tree) : tree_(tree), links_(unchecked_links(tree)) {}

    // What follows from a node of the set. f(node) hears of each that is new.
    template <class F>
    void add_needs_of(NodeId node, std::span<std::uint64_t> set, F&& f) {
        if (!links_.is_needing(node)) return;
        for (const NodeId need : links_.needs_of(node)) let_wait(need, set);
        add_waiting(set, f);
    }
    template <class F>
    void close(std::span<std::uint64_t> set, F&& f) {
        if (links_.needing.empty()) return;
        for_each_need(links_, set, [&](NodeId need) { let_wait(need, set); });
        add_waiting(set, f);
    }

private:
    void let_wait(NodeId need, std::span<const std::uint64_t> set) {
        if (const NodeId needed = need & ~joined_need; !test_bit(set, needed)) waiting_.push_back(needed);
    }

    template <class F>
    void add_waiting(std::span<std::uint64_t> set, F&& f) {
        while (!waiting_.empty()) {
            path_.clear();
            for (NodeId node = waiting_.back(); node < tree_.interior_count() && !test_bit(set, node);) {
                path_.push_back(node);
                const NodeId parent = links_.parents[node];
                if (parent != no_node && parent >= node) path_.clear(); // damaged
                node = path_.empty() ? no_node : parent;
            }
            waiting_.pop_back();
            for (; !path_.empty() && can_add(path_.back(), set); path_.pop_back()) {
                set_bit(set, path_.back());
                f(path_.back());
                if (!links_.is_needing(path_.back())) continue;
                for (const NodeId need : links_.needs_of(path_.back())) let_wait(need, set);
            }
        }
    }

    // A file may lie about parents, until the parents are found to be sound.
    bool can_add(NodeId node, std::span<const std::uint64_t> set) const {
        const NodeId parent = links_.parents[node];
        if (parent == no_node) return node == VertexTree::root() && tree_.is_sound(node);
        if (!test_bit(set, parent) || !tree_.is_sound(node)) return false;
        NodeId child = parent + 1;
        while (child < node) child = links_.subtree_end[child];
        return child == node;
    }

    const VertexTree& tree_;
    decltype(unchecked_links(tree_)) links_;
    std::vector<NodeId> waiting_, path_;
};

} // namespace unseen::vdtree
