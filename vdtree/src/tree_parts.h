// A tree in parts that can be worked on at the same time. What is bounded depends on the tree alone, not on the parts, and
// the parts on the tree alone, not on the threads.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <tbb/parallel_for.h>

#include "tree_shape.h"

namespace unseen::vdtree {

// A run of sibling subtrees.
struct TreePart {
    NodeId begin, end;                  // nodes
    Index first_leaf, leaf_end;
    Index first_triangle, triangle_end; // those that vanish in the part; one corner may be elsewhere

    bool holds(Index leaf) const { return leaf - first_leaf < leaf_end - first_leaf; }
};

struct TreeParts {
    std::vector<TreePart> parts;
    std::vector<NodeId> top;      // the nodes in no part, ascending
    std::vector<Index> crossing;  // the triangles that no part holds entirely, in a fixed order

    // Calls work(part) for all parts, perhaps at the same time.
    template <class Work>
    void for_each(Work&& work) const {
        tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t i) { work(parts[i]); });
    }

    // Calls one of make_worker()'s workers for each node, children before parents.
    template <class MakeWorker>
    void bottom_up(MakeWorker&& make_worker) const {
        for_each([&](const TreePart& part) {
            auto worker = make_worker();
            for (NodeId node = part.end; node-- > part.begin;) worker(node);
        });
        auto worker = make_worker();
        for (std::size_t i = top.size(); i-- > 0;) worker(top[i]);
    }

    // Calls work(t) for each triangle: for those that a part holds along with the other parts', then for the rest, one by one.
    // So work may change what belongs to the corners and to the nodes above them up to where the triangle vanishes.
    template <class Work>
    void for_each_triangle(std::span<const Triangle> triangles, Work&& work) const {
        for_each([&](const TreePart& part) {
            for (Index t = part.first_triangle; t < part.triangle_end; ++t)
                if (part.holds(triangles[t][0]) && part.holds(triangles[t][1]) && part.holds(triangles[t][2])) work(t);
        });
        for (const Index t : crossing) work(t);
    }
};

TreeParts part_tree(const TreeShape& shape, std::span<const Index> first_triangle, std::span<const Triangle> triangles);

} // namespace unseen::vdtree
