// A vertex as the GPU keeps it.
#pragma once

#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

namespace unseen::render {

struct Vertex {
    glm::vec3 position; // in the unit ball around the model
    glm::vec4 shade;    // linear RGB; relative luminance in a
};
static_assert(sizeof(Vertex) == 28, "the vertex layout and move.comp count on it");

} // namespace unseen::render
