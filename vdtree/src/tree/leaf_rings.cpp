#include "tree/leaf_rings.h"

namespace unseen::vdtree {

LeafRings find_rings(std::span<const Triangle> triangles, std::span<const std::uint8_t> irregular,
                     const TreeParts& parts) {
    const std::size_t leaves = irregular.size();
    // Around a regular vertex the triangles close up: each neighbour follows it in one triangle and precedes it in
    // another.
    const auto closed = [&](Index leaf) { return !irregular[leaf]; };
    LeafRings rings;
    rings.start.assign(leaves + 1, 0);
    parts.for_each_triangle([&](const TreePart& part) {
        return [&](Index t) {
            for (const Index leaf : triangles[t])
                if (parts.owns_leaf(part, leaf)) rings.start[leaf] += closed(leaf) ? 1 : 2;
        };
    });
    std::partial_sum(rings.start.begin(), rings.start.end(), rings.start.begin());
    rings.neighbours = ParallelArray<Index>(rings.start.back(), Unfilled());
    // From the end of each leaf's range, which is its start when all are in.
    parts.for_each_triangle([&](const TreePart& part) {
        return [&](Index t) {
            const Triangle& corners = triangles[t];
            for (std::size_t k = 0; k < 3; ++k) {
                if (!parts.owns_leaf(part, corners[k])) continue;
                Index& end = rings.start[corners[k]];
                rings.neighbours[--end] = corners[(k + 1) % 3];
                if (!closed(corners[k])) rings.neighbours[--end] = corners[(k + 2) % 3];
            }
        };
    });
    return rings;
}

} // namespace unseen::vdtree
