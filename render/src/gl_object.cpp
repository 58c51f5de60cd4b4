#include "gl_object.h"

#include "gl.h"

namespace unseen::render {

namespace {

thread_local bool are_objects_current = true;

GLenum label_kind(GlKind kind) {
    switch (kind) {
    case GlKind::buffer: return GL_BUFFER;
    case GlKind::vertex_array: return GL_VERTEX_ARRAY;
    case GlKind::texture_2d:
    case GlKind::texture_2d_array: return GL_TEXTURE;
    case GlKind::timestamp: return GL_QUERY;
    case GlKind::framebuffer: return GL_FRAMEBUFFER;
    case GlKind::program: return GL_PROGRAM;
    case GlKind::sampler: return GL_SAMPLER;
    }
    return GL_NONE;
}

} // namespace

void let_objects_go(bool are_in_current_context) noexcept { are_objects_current = are_in_current_context; }

unsigned make_object(GlKind kind, std::string_view label) {
    GLuint id = 0;
    switch (kind) {
    case GlKind::buffer: glCreateBuffers(1, &id); break;
    case GlKind::vertex_array: glCreateVertexArrays(1, &id); break;
    case GlKind::texture_2d: glCreateTextures(GL_TEXTURE_2D, 1, &id); break;
    case GlKind::texture_2d_array: glCreateTextures(GL_TEXTURE_2D_ARRAY, 1, &id); break;
    case GlKind::timestamp: glCreateQueries(GL_TIMESTAMP, 1, &id); break;
    case GlKind::framebuffer: glCreateFramebuffers(1, &id); break;
    case GlKind::program: id = glCreateProgram(); break;
    case GlKind::sampler: glCreateSamplers(1, &id); break;
    }
    if (id != 0 && !label.empty())
        glObjectLabel(label_kind(kind), id, static_cast<GLsizei>(label.size()), label.data());
    return id;
}

void delete_object(GlKind kind, unsigned id) noexcept {
    if (!are_objects_current) return;
    switch (kind) {
    case GlKind::buffer: return glDeleteBuffers(1, &id);
    case GlKind::vertex_array: return glDeleteVertexArrays(1, &id);
    case GlKind::texture_2d:
    case GlKind::texture_2d_array: return glDeleteTextures(1, &id);
    case GlKind::timestamp: return glDeleteQueries(1, &id);
    case GlKind::framebuffer: return glDeleteFramebuffers(1, &id);
    case GlKind::program: return glDeleteProgram(id);
    case GlKind::sampler: return glDeleteSamplers(1, &id);
    }
}

void disable(std::initializer_list<unsigned> capabilities) {
    for (const GLenum capability : capabilities) glDisable(capability);
}

void reset_pixel_stores() {
    for (const GLenum four : {GL_PACK_ALIGNMENT, GL_UNPACK_ALIGNMENT}) glPixelStorei(four, 4);
    for (const GLenum zero : {GL_PACK_ROW_LENGTH, GL_PACK_SKIP_ROWS, GL_PACK_SKIP_PIXELS, GL_UNPACK_ROW_LENGTH,
                              GL_UNPACK_SKIP_ROWS, GL_UNPACK_SKIP_PIXELS})
        glPixelStorei(zero, 0);
    glBindBuffer(GL_PIXEL_PACK_BUFFER, 0);
    glBindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
}

} // namespace unseen::render
