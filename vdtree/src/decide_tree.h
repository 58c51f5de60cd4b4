// Decides which nodes of a tree unfold, from the root down, a thousand at a time.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include <vdtree/vertex_tree.h>

#include "walk_children.h"

namespace unseen::vdtree {

class TreeDecider {
public:
    std::uint64_t decisions = 0; // in all runs

    // One bit a node that unfolds. `decide(nodes, bits)` says what would, one bit each in whole words; on_folded(node) hears of the
    // others under those that do (and of the root). Parents come before their children, and as far as that goes subtree by subtree, for
    // children lie beside their parents.
    template <class Decide, class OnFolded>
    std::vector<std::uint64_t> run(const VertexTree& tree, Decide&& decide, OnFolded&& on_folded) {
        constexpr std::size_t at_once = 1024; // what they read stays in the cache
        std::vector<std::uint64_t> unfolded((std::size_t{tree.interior_count()} + 63) / 64);
        waiting_.assign(1, VertexTree::root()); // the next ones last
        while (!waiting_.empty()) {
            const auto first = waiting_.end() - static_cast<std::ptrdiff_t>(std::min(at_once, waiting_.size()));
            piece_.assign(first, waiting_.end());
            waiting_.erase(first, waiting_.end());
            bits_.resize((piece_.size() + 63) / 64);
            decide(std::span<const NodeId>(piece_), bits_.data());
            decisions += piece_.size();
            unfolding_.clear();
            for (std::size_t i = 0; i < piece_.size(); ++i) {
                const NodeId node = piece_[i];
                if (((bits_[i / 64] >> (i % 64)) & 1) && tree.is_sound(node)) {
                    unfolded[node >> 6] |= std::uint64_t{1} << (node & 63);
                    unfolding_.push_back(node);
                } else {
                    on_folded(node);
                }
            }
            walk_children(tree, unfolding_.size(), [&](std::size_t i) { return unfolding_[i]; },
                          [&](std::size_t, NodeId child) { waiting_.push_back(child); });
        }
        return unfolded;
    }

private:
    std::vector<NodeId> waiting_, piece_, unfolding_;
    std::vector<std::uint64_t> bits_;
};

} // namespace unseen::vdtree
