// A light that goes around a model, for figures of what moving lights cost.
#pragma once

#include <unseen/vdtree/lighting.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::app {

enum class TurningLight {
    directional,
    point,      // three radii of the model away
    highlights, // directional, on a surface that shines
};

// Above the model, after so many degrees about its y axis; beside ambient light.
vdtree::Lighting lighting_at(const vdtree::VertexTree& tree, TurningLight kind, double degrees);

} // namespace unseen::app
