#include "vertex_mover.h"

#include <algorithm>
#include <numeric>

#include "shaders.h"

namespace unseen::render {
namespace {

constexpr unsigned group_size = 64; // of move.comp
constexpr GLuint moves_binding = 0, window_binding = 1;
constexpr int move_count_location = 0, window_first_location = 1, window_size_location = 2;
// As many as one pass takes: GL promises 65535 groups, and 2^24 bytes of a shader's block.
constexpr std::size_t most_moves = std::size_t{1} << 19;

// Windows onto the vertex buffer begin where a shader's binding may begin, with a whole vertex.
std::uint64_t vertices_in_a_window() {
    GLint64 most_bytes = 0;
    GLint alignment = 1;
    glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &most_bytes);
    glGetIntegerv(GL_SHADER_STORAGE_BUFFER_OFFSET_ALIGNMENT, &alignment);
    const auto step = std::lcm(static_cast<std::uint64_t>(std::max(alignment, 1)), std::uint64_t{sizeof(Vertex)});
    return static_cast<std::uint64_t>(most_bytes) / step * step / sizeof(Vertex);
}

} // namespace

Result<VertexMover> VertexMover::create(Programs& programs) {
    const ShaderSource source[] = {{ShaderSource::Stage::compute, shaders::move_comp}};
    const auto program = programs.named("move vertices", source);
    if (!program) return program.error();
    VertexMover mover(*program);
    mover.moves_ = Buffer::create("moved vertices");
    mover.window_vertices_ = vertices_in_a_window();
    if (mover.window_vertices_ == 0)
        return Error{ErrorCode::unsupported,
                     "The graphics driver gives shaders no buffer for moved vertices; draw without geomorphs."};
    return mover;
}

void VertexMover::move(unsigned vertices, std::uint64_t count, std::span<const VertexMove> moves) {
    for (; !moves.empty(); moves = moves.subspan(std::min(moves.size(), most_moves))) {
        const auto part = moves.first(std::min(moves.size(), most_moves));
        // A new store each time, so that the driver need not wait for the last frame.
        glNamedBufferData(moves_.id(), static_cast<GLsizeiptr>(part.size_bytes()), part.data(), GL_STREAM_DRAW);
        glBindBufferBase(GL_SHADER_STORAGE_BUFFER, moves_binding, moves_.id());
        program_->set(move_count_location, static_cast<unsigned>(part.size()));
        program_->use();
        for (std::uint64_t first = 0; first < count; first += window_vertices_) {
            const std::uint64_t size = std::min(window_vertices_, count - first);
            program_->set(window_first_location, static_cast<unsigned>(first));
            program_->set(window_size_location, static_cast<unsigned>(size));
            glBindBufferRange(GL_SHADER_STORAGE_BUFFER, window_binding, vertices,
                              static_cast<GLintptr>(first * sizeof(Vertex)),
                              static_cast<GLsizeiptr>(size * sizeof(Vertex)));
            glDispatchCompute(static_cast<GLuint>((part.size() + group_size - 1) / group_size), 1, 1);
        }
    }
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, moves_binding, 0);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, window_binding, 0);
    glMemoryBarrier(GL_VERTEX_ATTRIB_ARRAY_BARRIER_BIT | GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
}

} // namespace unseen::render
