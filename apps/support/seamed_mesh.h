// Meshes with seams and hard edges, as modellers make them: charts of one texture, and normals that are split at edges.
#pragma once

#include <unseen/vdtree/mesh.h>

namespace unseen::app {

// A shell with a crest and a recessed visor, open at the neck: 13 charts, each with a paint of its own, and hard edges
// along the crest, the visor and the rim. 20,000 triangles.
vdtree::Mesh helmet();
// A sphere with bumps and no hard edge: one chart around it, which ends in a pole, and another for its base. 9,000
// triangles.
vdtree::Mesh charted_ball();
// A gear with a bore, its axis upright. 40,000 triangles without a texture; flanks, tips and faces meet in hard edges.
vdtree::Mesh gear();
// A pile of boxes, each side a grid; 15,000 triangles without a texture.
vdtree::Mesh hard_boxes();

} // namespace unseen::app
