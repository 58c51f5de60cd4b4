// What surrounds each leaf.
#pragma once

#include "build/parallel_array.h"
#include "build/surface.h"
#include <unseen/vdtree/internal/tree_parts.h>

namespace unseen::vdtree {

// By leaf: the surface at its place.
struct LeafPlaces {
    std::vector<Index> weld;             // a leaf that stands for all at the same position
    std::vector<std::uint8_t> irregular; // whether an irregular edge ends there
    std::vector<std::uint8_t> alone;     // whether no other vertex is at the position
};

// By leaf: the leaves that it shares triangles with; once each where the surface is regular, else perhaps more often.
struct LeafRings {
    std::vector<Index> start; // one longer
    ParallelArray<Index> neighbours;

    std::span<const Index> around(Index leaf) const {
        return std::span<const Index>(neighbours).subspan(start[leaf], start[leaf + 1] - start[leaf]);
    }
};

LeafRings find_rings(std::span<const Triangle> triangles, const LeafPlaces& places, const TreeParts& parts);

} // namespace unseen::vdtree
