// A tree in parts that can be worked on at the same time. What is bounded depends on the tree alone, not on the parts, and
// the parts on the tree alone, not on the threads.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <tbb/parallel_for.h>

#include "tree_shape.h"

namespace unseen::vdtree {

// What one task works on: a run of sibling subtrees, or the nodes above all of these and the leaves that are their children.
struct TreePart {
    NodeId begin, end;                  // nodes; above the subtrees: all, of which it owns some
    Index first_leaf, leaf_end;         // likewise
    Index first_triangle, triangle_end; // those that vanish in the subtrees; empty above them
    std::vector<Index> crossing; // others that have a corner here; above the subtrees: all that no part holds entirely
};

class TreeParts {
public:
    // The links must stay where they are.
    explicit TreeParts(const TreeLinks& tree);

    // To be called before for_each_triangle().
    void assign_triangles(std::span<const Index> first_triangle, std::span<const Triangle> triangles);

    bool is_top(NodeId node) const { return is_top_[node]; }
    bool owns(const TreePart& part, NodeId node) const {
        return &part == &top_ ? is_top_[node] : node - part.begin < part.end - part.begin;
    }
    bool owns_leaf(const TreePart& part, Index leaf) const {
        return &part == &top_ ? is_top_[tree_.parents[tree_.node_of_leaf(leaf)]]
                              : leaf - part.first_leaf < part.leaf_end - part.first_leaf;
    }

    // Calls one of make_worker()'s workers for each node, children before parents, for several parts at the same time.
    template <class MakeWorker>
    void bottom_up(MakeWorker&& make_worker) const {
        tbb::parallel_for(std::size_t{0}, parts_.size(), [&](std::size_t i) {
            auto worker = make_worker();
            for (NodeId node = parts_[i].end; node-- > parts_[i].begin;) worker(node);
        });
        auto worker = make_worker();
        for (std::size_t i = top_nodes_.size(); i-- > 0;) worker(top_nodes_[i]);
    }

    // Calls make_worker(part)'s worker for each triangle that has a corner in the part, for several parts at the same time. Each
    // changes only what its part owns; the order of a part's triangles is fixed.
    template <class MakeWorker>
    void for_each_triangle(MakeWorker&& make_worker) const {
        const auto work = [&](const TreePart& part) {
            auto&& worker = make_worker(part);
            for (Index t = part.first_triangle; t < part.triangle_end; ++t) worker(t);
            for (const Index t : part.crossing) worker(t);
        };
        tbb::parallel_for(std::size_t{0}, parts_.size() + 1,
                          [&](std::size_t i) { work(i == 0 ? top_ : parts_[i - 1]); });
    }

private:
    TreeLinks tree_;
    std::vector<TreePart> parts_; // ascending
    TreePart top_;
    std::vector<NodeId> top_nodes_;    // ascending
    std::vector<std::uint8_t> is_top_; // by interior node
};

} // namespace unseen::vdtree
