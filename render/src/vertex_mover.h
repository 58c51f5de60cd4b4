// Vertices on the GPU, and overwriting single ones of a buffer, for a geomorph's frames.
#pragma once

#include "gl.h"
#include "program.h"
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::render {

// A vertex as the GPU keeps it.
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

struct VertexMove {
    std::uint32_t vertex = 0;
    Vertex to;
};
static_assert(sizeof(VertexMove) == 32, "move.comp counts on it");

// The moves are uploaded as they are, and a compute pass puts them in their places, in order with the drawing before
// and after it. Move-only; needs a current context for everything. GL errors are left for the caller to ask for.
class VertexMover {
public:
    static Result<VertexMover> create(Programs& programs); // which outlive it

    // No vertex twice. The buffer holds `count` vertices.
    void move(unsigned vertices, std::uint64_t count, std::span<const VertexMove> moves);

private:
    explicit VertexMover(const Program* program) : program_(program) {}

    const Program* program_;
    Buffer moves_;
    std::uint64_t window_vertices_ = 0; // as many as a shader may see at a time
};

} // namespace unseen::render
