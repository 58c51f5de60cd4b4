// What the safe fold tests take of the rings of all cuts.
#pragma once

#include <algorithm>
#include <vector>

#include <unseen/perception/internal/cut_rings.h>

namespace unseen::perception {

inline constexpr float length_rounding = 1e-6f; // covers that of a mean of two floats

// Half the extents of folds, mesh units: the change is largest within the support and fades to nothing at the ring's
// border. No less than the children's.
inline std::vector<float> safe_lengths(const vdtree::SoundTree& tree, const CutRings& rings) {
    std::vector<float> lengths(tree.interior_count(), 0.0f);
    for (vdtree::NodeId node = tree.interior_count(); node-- > 0;) {
        const float around = 0.5f * (tree.support_spheres()[node].radius + rings.radius[node]) * (1 + length_rounding);
        lengths[node] = std::max({lengths[node], tree.bounds()[node].ring.radius, around});
        if (node > 0) lengths[tree.parents()[node]] = std::max(lengths[tree.parents()[node]], lengths[node]);
    }
    return lengths;
}

// The directions that make nodes outlines; empty: the tree's. Where another part is near, any.
inline std::vector<vdtree::NormalSlabs> safe_facing(const vdtree::VertexTree& tree, const CutRings& rings) {
    std::vector<vdtree::NormalSlabs> facing;
    if (!rings.meets_another.empty())
        for (vdtree::NodeId node = 0; node < tree.interior_count(); ++node)
            facing.push_back(rings.meets_another[node] ? vdtree::NormalSlabs::everything() : tree.bounds()[node].slabs);
    return facing;
}

} // namespace unseen::perception
