// What surrounds each place while the tree is built.
#pragma once

#include "build/parallel_array.h"
#include "build/surface.h"
#include <unseen/vdtree/internal/tree_parts.h>

namespace unseen::vdtree {

// By place: the places that it shares triangles with; once each where the surface is regular, else perhaps more often.
struct LeafRings {
    std::vector<Index> start; // one longer
    ParallelArray<Index> neighbours;

    std::span<const Index> around(Index leaf) const {
        return std::span<const Index>(neighbours).subspan(start[leaf], start[leaf + 1] - start[leaf]);
    }
};

// `irregular`: by place, whether an irregular edge ends there.
LeafRings find_rings(std::span<const Triangle> triangles, std::span<const std::uint8_t> irregular,
                     const TreeParts& parts);

} // namespace unseen::vdtree
