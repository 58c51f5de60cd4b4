// A followed cut in OpenGL of your own: Unseen says what changes, and nothing here draws by unseen::render.
//
// Vertices are uploaded once. After that, the CPU sends which triangles came, and which wedge stands for which leaves now;
// the GPU keeps both and makes the index buffer of them. Copy what you need.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#define GL_GLEXT_PROTOTYPES 1
#include <GL/glcorearb.h>

#include <unseen/vdtree/active_triangles.h>

namespace samples {

inline GLuint link(GLuint program, GLenum kind, const char* text) {
    const GLuint shader = glCreateShader(kind);
    glShaderSource(shader, 1, &text, nullptr);
    glCompileShader(shader);
    glAttachShader(program, shader);
    glDeleteShader(shader); // when the program goes
    glLinkProgram(program);
    return program;
}

class PlainCut {
public:
    // In the context that is current, 4.5 or newer, which must be so in all calls.
    explicit PlainCut(const unseen::vdtree::VertexTree& tree) : active_(tree) {
        glCreateVertexArrays(1, &array_);
        glCreateBuffers(6, buffers_);
        // By wedge: a triangle's numbers lead into these, whatever the cut. Positions are relative to tree.origin().
        const auto positions = tree.positions();
        glNamedBufferStorage(positions_, static_cast<GLsizeiptr>(positions.size_bytes()), positions.data(), 0);
        const auto luminance = tree.luminance(); // 16 bits, 0 to 1, lit by the tree's light
        glNamedBufferStorage(luminances_, static_cast<GLsizeiptr>(luminance.size_bytes()), luminance.data(), 0);
        // As large as any cut can be.
        const auto most = static_cast<GLsizeiptr>(std::max<std::uint64_t>(tree.triangle_count(), 1)) * 3;
        for (const GLuint buffer : {corners_, indices_})
            glNamedBufferStorage(buffer, most * static_cast<GLsizeiptr>(sizeof(GLuint)), nullptr,
                                 GL_DYNAMIC_STORAGE_BIT);
        const auto attribute = [&](GLuint at, GLuint buffer, GLsizei stride, GLint count, GLenum type, GLboolean norm) {
            glVertexArrayVertexBuffer(array_, at, buffer, 0, stride);
            glVertexArrayAttribFormat(array_, at, count, type, norm, 0);
            glVertexArrayAttribBinding(array_, at, at);
            glEnableVertexArrayAttrib(array_, at);
        };
        attribute(0, positions_, sizeof(glm::vec3), 3, GL_FLOAT, GL_FALSE);
        attribute(1, luminances_, sizeof(unseen::vdtree::Unorm16), 1, GL_UNSIGNED_SHORT, GL_TRUE);
        glVertexArrayElementBuffer(array_, indices_);
        link(take_up_, GL_COMPUTE_SHADER, R"(#version 450 core
            layout(local_size_x = 64) in;
            layout(std430, binding = 0) readonly buffer Changes { uvec4 changes[]; };
            layout(std430, binding = 1) writeonly buffer Corners { uint leaf_at_corner[]; };
            layout(std430, binding = 2) writeonly buffer Wedges { uint wedge_of_leaf[]; };
            layout(location = 0) uniform uint count;
            void main() {
                if (gl_GlobalInvocationID.x >= count) return;
                uvec4 change = changes[gl_GlobalInvocationID.x];
                if (change.w == 0xffffffffu) // a run of leaves: the first one, how many, their wedge
                    for (uint i = 0; i < change.y; ++i) wedge_of_leaf[change.x + i] = change.z;
                else // a triangle: its slot and its leaves
                    for (uint k = 0; k < 3; ++k) leaf_at_corner[3 * change.x + k] = change[k + 1];
            })");
        link(index_, GL_COMPUTE_SHADER, R"(#version 450 core
            layout(local_size_x = 256) in;
            layout(std430, binding = 1) readonly buffer Corners { uint leaf_at_corner[]; };
            layout(std430, binding = 2) readonly buffer Wedges { uint wedge_of_leaf[]; };
            layout(std430, binding = 3) writeonly buffer Indices { uint indices[]; };
            layout(location = 0) uniform uint count;
            void main() {
                uint step = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
                for (uint i = gl_GlobalInvocationID.x; i < count; i += step)
                    indices[i] = wedge_of_leaf[leaf_at_corner[i]];
            })");
    }
    PlainCut(const PlainCut&) = delete;
    PlainCut& operator=(const PlainCut&) = delete;
    ~PlainCut() {
        glDeleteVertexArrays(1, &array_);
        glDeleteBuffers(6, buffers_);
        glDeleteProgram(take_up_);
        glDeleteProgram(index_);
    }

    // After each follow() of the cut, which is always the same one. Uploads what changed, or all of it where too much
    // did. Returns the bytes.
    std::size_t upload(const unseen::vdtree::Cut& cut) {
        const bool is_known = active_.update(cut);
        const auto corners = active_.leaves_at_corners();
        const auto wedges = active_.wedges_of_leaves();
        count_ = static_cast<GLsizei>(3 * corners.size());
        std::size_t bytes = corners.size_bytes() + wedges.size_bytes();
        for (GLuint i = 1; i < 4; ++i) glBindBufferBase(GL_SHADER_STORAGE_BUFFER, i, buffers_[i]);
        if (is_known) {
            changes_.clear();
            for (const auto slot : active_.changed_slots())
                changes_.push_back({slot, corners[slot][0], corners[slot][1], corners[slot][2]});
            for (const auto& run : active_.changed_runs()) changes_.push_back({run.first, run.count, run.wedge, ~0u});
            if (changes_.empty()) return 0;
            bytes = changes_.size() * sizeof(changes_[0]);
            glNamedBufferData(changed_, static_cast<GLsizeiptr>(bytes), changes_.data(), GL_STREAM_DRAW);
            glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, changed_);
            compute(take_up_, changes_.size(), 64);
            glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
        } else {
            glNamedBufferSubData(corners_, 0, static_cast<GLsizeiptr>(corners.size_bytes()), corners.data());
            glNamedBufferData(wedges_, static_cast<GLsizeiptr>(wedges.size_bytes()), wedges.data(), GL_DYNAMIC_COPY);
            glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 2, wedges_);
        }
        compute(index_, static_cast<std::size_t>(count_), 256);
        glMemoryBarrier(GL_ELEMENT_ARRAY_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
        return bytes;
    }

    // With your own program: position at location 0, luminance at 1.
    void draw() const {
        glBindVertexArray(array_);
        glDrawElements(GL_TRIANGLES, count_, GL_UNSIGNED_INT, nullptr);
        glBindVertexArray(0);
    }

private:
    static void compute(GLuint program, std::size_t count, std::size_t group_size) {
        constexpr std::size_t most_groups = 65535;
        glUseProgram(program);
        glUniform1ui(0, static_cast<GLuint>(count));
        glDispatchCompute(static_cast<GLuint>(std::min((count + group_size - 1) / group_size, most_groups)), 1, 1);
    }

    unseen::vdtree::ActiveTriangles active_;
    std::vector<std::array<GLuint, 4>> changes_;
    GLuint array_ = 0, buffers_[6] = {};
    GLuint &changed_ = buffers_[0], &corners_ = buffers_[1], &wedges_ = buffers_[2], &indices_ = buffers_[3];
    GLuint &positions_ = buffers_[4], &luminances_ = buffers_[5];
    GLuint take_up_ = glCreateProgram(), index_ = glCreateProgram();
    GLsizei count_ = 0;
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
    link(program, GL_VERTEX_SHADER, vertex);
    return link(program, GL_FRAGMENT_SHADER, fragment);
}

} // namespace samples
