// Decides which nodes of a tree unfold, from the root down, a thousand at a time.
#pragma once

#include <unseen/vdtree/internal/node_bits.h>

#include "tree/unchecked_links.h"

namespace unseen::vdtree {

class TreeDecider {
public:
    std::uint64_t decisions = 0; // in all runs

    // One bit a node that unfolds. `decide(nodes, bits)` says what would, one bit each in whole words; on_folded(nodes)
    // hears of the others under those that do (and of the root), some at a time. Parents come before their children,
    // and as far as that goes subtree by subtree, for children lie beside their parents.
    template <class Decide, class OnFolded>
    std::vector<std::uint64_t> run(const VertexTree& tree, Decide&& decide, OnFolded&& on_folded) {
        constexpr std::size_t at_once = 1024; // what they read stays in the cache
        std::vector<std::uint64_t> unfolded(words_for(tree.interior_count()));
        waiting_.assign(1, VertexTree::root()); // the next ones last
        while (!waiting_.empty()) {
            const auto first = waiting_.end() - static_cast<std::ptrdiff_t>(std::min(at_once, waiting_.size()));
            piece_.assign(first, waiting_.end());
            waiting_.erase(first, waiting_.end());
            bits_.resize(words_for(piece_.size()));
            decide(std::span<const NodeId>(piece_), bits_.data());
            decisions += piece_.size();
            part();
            std::erase_if(unfolding_, [&](NodeId node) {
                if (tree.is_sound(node)) return false;
                folded_.push_back(node);
                return true;
            });
            for (const NodeId node : unfolding_) set_bit(unfolded, node);
            if (!folded_.empty()) on_folded(std::span<const NodeId>(folded_));
            add_children(unchecked_links(tree).subtree_end);
        }
        return unfolded;
    }

private:
    // The piece by its bits. They are unpredictable, so branch-free; likewise below.
    void part() {
        unfolding_.resize(piece_.size());
        folded_.resize(piece_.size());
        std::size_t unfolding = 0, folded = 0;
        for (std::size_t i = 0; i < piece_.size(); ++i) {
            const bool unfolds = test_bit(bits_, i);
            // Never beyond the ends: neither list is longer than i.
            unfolding_[unfolding] = folded_[folded] = piece_[i];
            unfolding += unfolds;
            folded += !unfolds;
        }
        unfolding_.resize(unfolding);
        folded_.resize(folded);
    }

    // The interior children of unfolding_ wait. Most nodes have at most two: the node's neighbour, and one that is
    // anywhere.
    void add_children(std::span<const NodeId> subtree_end) {
        constexpr std::size_t far = 64, near = 32; // nodes between a prefetch and its use
        const std::size_t count = unfolding_.size();
        const auto first_child = [&](NodeId node) {
            return node + 1 < subtree_end[node] ? node + 1 : node;
        }; // or itself
        for (std::size_t i = 0; i < std::min(far, count); ++i) prefetch(&subtree_end[unfolding_[i]]);
        std::size_t end = waiting_.size();
        waiting_.resize(end + 2 * count);
        for (std::size_t i = 0; i < count; ++i) {
            if (i + far < count) prefetch(&subtree_end[unfolding_[i + far]]);
            if (i + near < count) {
                const NodeId soon = unfolding_[i + near], second = subtree_end[first_child(soon)];
                prefetch(&subtree_end[second < subtree_end[soon] ? second : soon]);
            }
            const NodeId node = unfolding_[i], after = subtree_end[node], first = first_child(node),
                         second = subtree_end[first];
            waiting_[end] = first;
            end += first != node;
            waiting_[end] = second;
            end += second < after;
            if (second >= after) continue;
            for (NodeId child = subtree_end[second]; child < after; child = subtree_end[child])
                others_.push_back(child);
        }
        waiting_.resize(end);
        waiting_.insert(waiting_.end(), others_.begin(), others_.end());
        others_.clear();
    }

    std::vector<NodeId> waiting_, piece_, unfolding_, folded_, others_;
    std::vector<std::uint64_t> bits_;
};

} // namespace unseen::vdtree
