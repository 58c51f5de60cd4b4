// A mesh for where none is at hand.
#pragma once

#include <unseen/vdtree/mesh.h>

namespace unseen::app {

// A closed sphere with bumps, radius about 1: 4 * rows * rows triangles (at the poles without area).
vdtree::Mesh bumpy_sphere(int rows);

} // namespace unseen::app
