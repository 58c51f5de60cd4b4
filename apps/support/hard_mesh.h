// Meshes made to be hard for fold tests.
#pragma once

#include <string>
#include <vector>

#include <vdtree/builder.h>

namespace unseen::app {

// One that simplifies by the builder's own clustering or, where `proxies_at_darkest` says so, by cells whose proxies
// are all at the darkest of the vertices that they stand for: shifts that add up.
struct HardMesh {
    std::string name;
    vdtree::Mesh mesh;
    bool proxies_at_darkest = false;
};

// Noise of 4% by vertex, a checkerboard of luminance, plates so thin that folds poke through, long thin triangles, a
// surface inside out, an open one. Of about so many triangles each; at least a thousand.
std::vector<HardMesh> hard_meshes(int triangles);

Result<vdtree::VertexTree> build_hard_tree(const HardMesh& hard);

} // namespace unseen::app
