// Meshes made to be hard for fold tests, and others to fit their factors on.
#pragma once

#include <string>
#include <vector>

#include <unseen/vdtree/builder.h>

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

// What the factors of the fold test by errors are fitted on, and nothing else: a rough and a painted blob, an open
// terrain, flat lenses and boxes that pass through each other, a column of long triangles. Of about so many triangles each; at least a thousand.
std::vector<HardMesh> tuning_meshes(int triangles);

// Open sheets, whose borders are all that a flat sheet shows of its folds: regular waves of various heights and lengths,
// one with its faces in another order; two plates that meet in a crease, welded, with a border each, and with vertices
// of each facet's own; a jagged outline, holes, a spiral. Of about so many triangles each; at least a thousand.
std::vector<HardMesh> open_sheets(int triangles);

// An open square from -1 to 1, of about so many triangles, waved along both sides: `waves` along each, so high. The errors
// of its folds are alike everywhere, the worst that is known.
HardMesh waved_square(int triangles, double height, double waves);

Result<vdtree::VertexTree> build_hard_tree(const HardMesh& hard);

} // namespace unseen::app
