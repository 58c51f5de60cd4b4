// A tree in parts that can be worked on at the same time. What is bounded depends on the tree alone, not on the parts,
// and the parts on the tree alone, not on the threads.
#pragma once

#include <numeric>

#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/tree_shape.h>

namespace unseen::vdtree {

// What one task works on: a run of sibling subtrees, or the nodes above all of these and the leaves that are their
// children.
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
    bool is_top(const TreePart& part) const { return &part == &top_; }
    bool owns(const TreePart& part, NodeId node) const {
        return is_top(part) ? is_top_[node] : node - part.begin < part.end - part.begin;
    }
    bool owns_leaf(const TreePart& part, Index leaf) const {
        return is_top(part) ? is_top_[tree_.parents[tree_.place_of_leaf(leaf)]]
                            : leaf - part.first_leaf < part.leaf_end - part.first_leaf;
    }

    // Calls one of make_worker()'s or make_worker(part)'s workers for each node, children before parents, for several parts
    // at the same time.
    template <class MakeWorker>
    void bottom_up(MakeWorker&& make_worker) const {
        const auto make = [&](const TreePart& part) {
            if constexpr (std::is_invocable_v<MakeWorker&, const TreePart&>) return make_worker(part);
            else return make_worker();
        };
        parallel_loop(std::size_t{0}, parts_.size(), [&](std::size_t i) {
            auto worker = make(parts_[i]);
            for (NodeId node = parts_[i].end; node-- > parts_[i].begin;) worker(node);
        });
        auto worker = make(top_);
        for (std::size_t i = top_nodes_.size(); i-- > 0;) worker(top_nodes_[i]);
    }

    // Calls one of make_worker()'s workers with the nodes of each part, ascending, for several parts at the same time;
    // in the end with those above.
    template <class MakeWorker>
    void part_by_part(MakeWorker&& make_worker) const {
        parallel_loop(std::size_t{0}, parts_.size(), [&](std::size_t i) {
            std::vector<NodeId> nodes(parts_[i].end - parts_[i].begin);
            std::iota(nodes.begin(), nodes.end(), parts_[i].begin);
            make_worker()(std::span<const NodeId>(nodes));
        });
        make_worker()(std::span<const NodeId>(top_nodes_));
    }

    // Calls f(part) for all parts, among them what is above the others, several at the same time.
    template <class F>
    void for_each(F&& f) const {
        parallel_loop(std::size_t{0}, count(), [&](std::size_t i) { f((*this)[i]); });
    }
    std::size_t count() const { return parts_.size() + 1; }
    const TreePart& operator[](std::size_t i) const { return i == 0 ? top_ : parts_[i - 1]; }

    // Calls f for each triangle that has a corner in the part, in a fixed order.
    template <class F>
    static void for_each_triangle(const TreePart& part, F&& f) {
        for (Index t = part.first_triangle; t < part.triangle_end; ++t) f(t);
        for (const Index t : part.crossing) f(t);
    }
    // Calls make_worker(part)'s worker for these, for several parts at the same time. Each changes only what its part
    // owns.
    template <class MakeWorker>
    void for_each_triangle(MakeWorker&& make_worker) const {
        for_each([&](const TreePart& part) { for_each_triangle(part, make_worker(part)); });
    }

private:
    TreeLinks tree_;
    std::vector<TreePart> parts_; // ascending
    TreePart top_;
    std::vector<NodeId> top_nodes_;    // ascending
    std::vector<std::uint8_t> is_top_; // by interior node
};

} // namespace unseen::vdtree
