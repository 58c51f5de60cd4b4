// Creation, deletion and labels of the kinds of GL objects.
#include "gl_object.h"

#include "gl.h"

namespace unseen::render {

namespace {
thread_local bool are_objects_current = true;
}

void let_objects_go(bool are_in_current_context) noexcept { are_objects_current = are_in_current_context; }

struct BufferTraits {
    static constexpr GLenum kind = GL_BUFFER;
    static void create(GLuint* id) { glCreateBuffers(1, id); }
    static void destroy(GLuint id) { glDeleteBuffers(1, &id); }
};

struct VertexArrayTraits {
    static constexpr GLenum kind = GL_VERTEX_ARRAY;
    static void create(GLuint* id) { glCreateVertexArrays(1, id); }
    static void destroy(GLuint id) { glDeleteVertexArrays(1, &id); }
};

struct Texture2dTraits {
    static constexpr GLenum kind = GL_TEXTURE;
    static void create(GLuint* id) { glCreateTextures(GL_TEXTURE_2D, 1, id); }
    static void destroy(GLuint id) { glDeleteTextures(1, &id); }
};

struct Texture2dArrayTraits {
    static constexpr GLenum kind = GL_TEXTURE;
    static void create(GLuint* id) { glCreateTextures(GL_TEXTURE_2D_ARRAY, 1, id); }
    static void destroy(GLuint id) { glDeleteTextures(1, &id); }
};

struct TimestampTraits {
    static constexpr GLenum kind = GL_QUERY;
    static void create(GLuint* id) { glCreateQueries(GL_TIMESTAMP, 1, id); }
    static void destroy(GLuint id) { glDeleteQueries(1, &id); }
};

struct RenderbufferTraits {
    static constexpr GLenum kind = GL_RENDERBUFFER;
    static void create(GLuint* id) { glCreateRenderbuffers(1, id); }
    static void destroy(GLuint id) { glDeleteRenderbuffers(1, &id); }
};

struct FramebufferTraits {
    static constexpr GLenum kind = GL_FRAMEBUFFER;
    static void create(GLuint* id) { glCreateFramebuffers(1, id); }
    static void destroy(GLuint id) { glDeleteFramebuffers(1, &id); }
};

struct ProgramTraits {
    static constexpr GLenum kind = GL_PROGRAM;
    static void create(GLuint* id) { *id = glCreateProgram(); }
    static void destroy(GLuint id) { glDeleteProgram(id); }
};

struct SamplerTraits {
    static constexpr GLenum kind = GL_SAMPLER;
    static void create(GLuint* id) { glCreateSamplers(1, id); }
    static void destroy(GLuint id) { glDeleteSamplers(1, &id); }
};

template <class Traits>
GlObject<Traits> GlObject<Traits>::create(std::string_view label) {
    GLuint id = 0;
    Traits::create(&id);
    if (id != 0 && !label.empty()) glObjectLabel(Traits::kind, id, static_cast<GLsizei>(label.size()), label.data());
    return GlObject(id);
}

template <class Traits>
GlObject<Traits>::~GlObject() {
    if (id_ != 0 && are_objects_current) Traits::destroy(id_);
}

template class GlObject<BufferTraits>;
template class GlObject<VertexArrayTraits>;
template class GlObject<Texture2dTraits>;
template class GlObject<Texture2dArrayTraits>;
template class GlObject<TimestampTraits>;
template class GlObject<RenderbufferTraits>;
template class GlObject<FramebufferTraits>;
template class GlObject<ProgramTraits>;
template class GlObject<SamplerTraits>;

} // namespace unseen::render
