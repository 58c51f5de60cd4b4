// A tree's arrays while it is built: bounds at full width and apart, as the steps of the builder fill them one by one.
#pragma once

#include <vector>

#include "vertex_tree_data.h"

namespace unseen::vdtree {

struct TreeDraft : GeometryArrays<Vector>, GeometryFacts {
    std::vector<glm::vec3> exact_normals; // by node
    std::vector<Sphere> ring_spheres;     // by interior node, and so on
    std::vector<NormalMask> masks;
    std::vector<NormalSlabs> slabs;
    std::vector<std::uint8_t> flags;
};

// Packs those arrays and frees them one by one. Luminance is derived from the packed normals, so that other light on a tree
// gives what building it with that light would.
TreeGeometry pack(TreeDraft&& draft);

} // namespace unseen::vdtree
