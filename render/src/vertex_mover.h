// Overwrites single vertices of a vertex buffer on the GPU, for a geomorph's frames.
#pragma once

#include <cstdint>
#include <span>

#include "gl_object.h"

#include "gl.h"
#include "programs.h"
#include "vertex.h"

namespace unseen::render {

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
