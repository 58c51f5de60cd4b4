// A vertex as the GPU keeps it.
#pragma once

#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <unseen/vdtree/vertex_tree.h>

namespace unseen::render {

struct Vertex {
    glm::vec3 position; // in the unit ball around the model
    glm::vec4 shade;    // linear RGB; relative luminance in a
};
static_assert(sizeof(Vertex) == 28, "the vertex layout and move.comp count on it");

// What lights want to know of it, in a buffer of its own that is made when there are some.
struct LitVertex {
    vdtree::PackedNormal normal;
    float albedo;
};
static_assert(sizeof(LitVertex) == 8);

} // namespace unseen::render
