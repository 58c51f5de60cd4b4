// A followed cut in OpenGL of your own: Unseen makes the triangles, and nothing here draws by unseen::render.
//
// Vertices are uploaded once. The index buffer is patched: follow() says which places changed. Copy what you need.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#define GL_GLEXT_PROTOTYPES 1
#include <GL/glcorearb.h>

#include <unseen/vdtree/cut.h>

namespace samples {

class PlainCut {
public:
    // In the context that is current, 4.5 or newer, which must be so in all calls.
    explicit PlainCut(const unseen::vdtree::VertexTree& tree) {
        glCreateVertexArrays(1, &array_);
        glCreateBuffers(3, buffers_);
        // By wedge: a triangle's numbers lead into these, whatever the cut. Positions are relative to tree.origin().
        const auto positions = tree.positions();
        glNamedBufferStorage(positions_, static_cast<GLsizeiptr>(positions.size_bytes()), positions.data(), 0);
        const auto luminance = tree.luminance(); // 16 bits, 0 to 1, lit by the tree's light
        glNamedBufferStorage(luminances_, static_cast<GLsizeiptr>(luminance.size_bytes()), luminance.data(), 0);
        // As large as any cut can be.
        const auto most = static_cast<GLsizeiptr>(std::max<std::uint64_t>(tree.triangle_count(), 1)) * 3;
        glNamedBufferStorage(indices_, most * static_cast<GLsizeiptr>(sizeof(GLuint)), nullptr, GL_DYNAMIC_STORAGE_BIT);
        const auto attribute = [&](GLuint at, GLuint buffer, GLsizei stride, GLint count, GLenum type, GLboolean norm) {
            glVertexArrayVertexBuffer(array_, at, buffer, 0, stride);
            glVertexArrayAttribFormat(array_, at, count, type, norm, 0);
            glVertexArrayAttribBinding(array_, at, at);
            glEnableVertexArrayAttrib(array_, at);
        };
        attribute(0, positions_, sizeof(glm::vec3), 3, GL_FLOAT, GL_FALSE);
        attribute(1, luminances_, sizeof(unseen::vdtree::Unorm16), 1, GL_UNSIGNED_SHORT, GL_TRUE);
        glVertexArrayElementBuffer(array_, indices_);
    }
    PlainCut(const PlainCut&) = delete;
    PlainCut& operator=(const PlainCut&) = delete;
    ~PlainCut() {
        glDeleteVertexArrays(1, &array_);
        glDeleteBuffers(3, buffers_);
    }

    // After each follow() of the cut, which is always the same one. Uploads the places that changed, or all of them where
    // too many did. Returns the bytes.
    std::size_t upload(const unseen::vdtree::Cut& cut) {
        const auto indices = cut.indices(); // first: it makes the version and the writes those of now
        count_ = static_cast<GLsizei>(indices.size());
        if (cut.index_version() == version_) return 0; // nothing has changed
        const auto writes = cut.index_writes();
        const bool is_patch = writes && cut.index_writes_from() == version_;
        version_ = cut.index_version();
        if (!is_patch) return send(indices, 0, indices.size());
        // What is there now counts, so the order of the writes does not: neighbours go together.
        places_.clear();
        for (const unseen::vdtree::IndexWrite& write : *writes)
            if (write.place < indices.size()) places_.push_back(write.place);
        std::sort(places_.begin(), places_.end());
        std::size_t bytes = 0;
        for (std::size_t i = 0; i < places_.size();) {
            const std::size_t first = places_[i];
            std::size_t end = first;
            constexpr std::size_t gap = 64; // places: sending these again is cheaper than another call
            for (; i < places_.size() && places_[i] < end + gap; ++i) end = places_[i] + 1;
            bytes += send(indices, first, end);
        }
        return bytes;
    }

    // With your own program: position at location 0, luminance at 1.
    void draw() const {
        glBindVertexArray(array_);
        glDrawElements(GL_TRIANGLES, count_, GL_UNSIGNED_INT, nullptr);
        glBindVertexArray(0);
    }

private:
    std::size_t send(std::span<const unseen::vdtree::WedgeId> indices, std::size_t first, std::size_t end) {
        const std::size_t size = sizeof(GLuint), bytes = (end - first) * size;
        if (bytes > 0)
            glNamedBufferSubData(indices_, static_cast<GLintptr>(first * size), static_cast<GLsizeiptr>(bytes),
                                 indices.data() + first);
        return bytes;
    }

    GLuint array_ = 0, buffers_[3] = {};
    GLuint &positions_ = buffers_[0], &luminances_ = buffers_[1], &indices_ = buffers_[2];
    GLsizei count_ = 0;
    std::uint64_t version_ = 0; // of the index buffer; 0: of none
    std::vector<std::size_t> places_;
};

// A program for it: relative luminance, linear.
inline GLuint make_plain_program() {
    const char* const vertex = R"(#version 450 core
        layout(location = 0) in vec3 position;
        layout(location = 1) in float luminance;
        layout(location = 0) uniform mat4 clip_from_tree;
        out float shade;
        void main() {
            shade = luminance;
            gl_Position = clip_from_tree * vec4(position, 1);
        })";
    const char* const fragment = R"(#version 450 core
        in float shade;
        out vec4 colour;
        void main() { colour = vec4(shade, shade, shade, 1); })";
    const GLuint program = glCreateProgram();
    for (const auto& [kind, text] : {std::pair{GL_VERTEX_SHADER, vertex}, std::pair{GL_FRAGMENT_SHADER, fragment}}) {
        const GLuint shader = glCreateShader(static_cast<GLenum>(kind));
        glShaderSource(shader, 1, &text, nullptr);
        glCompileShader(shader);
        glAttachShader(program, shader);
        glDeleteShader(shader); // when the program goes
    }
    glLinkProgram(program);
    return program;
}

} // namespace samples
