#include "kept_state.h"

#include <algorithm>
#include <array>

namespace unseen::render {
namespace {

constexpr GLenum switches[] = {GL_CULL_FACE,   GL_DEPTH_TEST,          GL_STENCIL_TEST,
                               GL_DITHER,      GL_RASTERIZER_DISCARD,  GL_COLOR_LOGIC_OP,
                               GL_DEPTH_CLAMP, GL_POLYGON_OFFSET_FILL, GL_SAMPLE_ALPHA_TO_COVERAGE,
                               GL_SAMPLE_MASK, GL_PRIMITIVE_RESTART,   GL_FRAMEBUFFER_SRGB,
                               GL_MULTISAMPLE, GL_PROGRAM_POINT_SIZE};

constexpr GLenum stores[] = {GL_PACK_ALIGNMENT,   GL_PACK_ROW_LENGTH,   GL_PACK_SKIP_ROWS,   GL_PACK_SKIP_PIXELS,
                             GL_UNPACK_ALIGNMENT, GL_UNPACK_ROW_LENGTH, GL_UNPACK_SKIP_ROWS, GL_UNPACK_SKIP_PIXELS};

struct Binding {
    GLenum target, name;
};
constexpr Binding buffers[] = {{GL_ARRAY_BUFFER, GL_ARRAY_BUFFER_BINDING},
                               {GL_PIXEL_PACK_BUFFER, GL_PIXEL_PACK_BUFFER_BINDING},
                               {GL_PIXEL_UNPACK_BUFFER, GL_PIXEL_UNPACK_BUFFER_BINDING},
                               {GL_SHADER_STORAGE_BUFFER, GL_SHADER_STORAGE_BUFFER_BINDING}};

// All that a unit may hold: glBindTextureUnit(unit, 0) takes all of it away.
constexpr GLenum texture_bindings[] = {GL_TEXTURE_BINDING_1D,
                                       GL_TEXTURE_BINDING_1D_ARRAY,
                                       GL_TEXTURE_BINDING_2D,
                                       GL_TEXTURE_BINDING_2D_ARRAY,
                                       GL_TEXTURE_BINDING_2D_MULTISAMPLE,
                                       GL_TEXTURE_BINDING_2D_MULTISAMPLE_ARRAY,
                                       GL_TEXTURE_BINDING_3D,
                                       GL_TEXTURE_BINDING_BUFFER,
                                       GL_TEXTURE_BINDING_CUBE_MAP,
                                       GL_TEXTURE_BINDING_CUBE_MAP_ARRAY,
                                       GL_TEXTURE_BINDING_RECTANGLE};

GLint value_of(GLenum name) {
    GLint value = 0;
    glGetIntegerv(name, &value);
    return value;
}
GLuint mode_of(GLenum name) { return static_cast<GLuint>(value_of(name)); }
GLuint mode_at(GLenum name, GLuint index) {
    GLint value = 0;
    glGetIntegeri_v(name, index, &value);
    return static_cast<GLuint>(value);
}
GLuint count_of(GLenum most, GLuint wanted) {
    return std::min(wanted, static_cast<GLuint>(std::max(value_of(most), 0)));
}

void set(GLenum what, bool is_on) {
    if (is_on) glEnable(what);
    else glDisable(what);
}
void set_at(GLenum what, GLuint index, bool is_on) {
    if (is_on) glEnablei(what, index);
    else glDisablei(what, index);
}

} // namespace

void KeptState::keep_blending(GLuint i) {
    const std::array values = {mode_at(GL_BLEND_SRC_RGB, i),      mode_at(GL_BLEND_DST_RGB, i),
                               mode_at(GL_BLEND_SRC_ALPHA, i),    mode_at(GL_BLEND_DST_ALPHA, i),
                               mode_at(GL_BLEND_EQUATION_RGB, i), mode_at(GL_BLEND_EQUATION_ALPHA, i)};
    std::array<GLboolean, 4> mask{};
    glGetBooleani_v(GL_COLOR_WRITEMASK, i, mask.data());
    keep([=, is_on = glIsEnabledi(GL_BLEND, i) == GL_TRUE] {
        set_at(GL_BLEND, i, is_on);
        glBlendFuncSeparatei(i, values[0], values[1], values[2], values[3]);
        glBlendEquationSeparatei(i, values[4], values[5]);
        glColorMaski(i, mask[0], mask[1], mask[2], mask[3]);
    });
}

void KeptState::keep_window(GLuint i) {
    std::array<GLfloat, 4> viewport{};
    std::array<GLint, 4> scissor{};
    std::array<GLdouble, 2> depth_range{};
    glGetFloati_v(GL_VIEWPORT, i, viewport.data());
    glGetIntegeri_v(GL_SCISSOR_BOX, i, scissor.data());
    glGetDoublei_v(GL_DEPTH_RANGE, i, depth_range.data());
    keep([=, is_scissored = glIsEnabledi(GL_SCISSOR_TEST, i) == GL_TRUE] {
        glViewportIndexedfv(i, viewport.data());
        glScissorIndexedv(i, scissor.data());
        glDepthRangeIndexed(i, depth_range[0], depth_range[1]);
        set_at(GL_SCISSOR_TEST, i, is_scissored);
    });
}

void KeptState::keep_unit(GLuint unit) {
    std::vector<GLuint> textures; // that are bound
    for (const GLenum binding : texture_bindings)
        if (const GLuint texture = mode_at(binding, unit); texture != 0) textures.push_back(texture);
    keep([=, sampler = mode_at(GL_SAMPLER_BINDING, unit)] {
        glBindTextureUnit(unit, 0);
        for (const GLuint texture : textures) glBindTextureUnit(unit, texture);
        glBindSampler(unit, sampler);
    });
}

void KeptState::keep_storage(GLuint i) {
    GLint64 start = 0, size = 0;
    glGetInteger64i_v(GL_SHADER_STORAGE_BUFFER_START, i, &start);
    glGetInteger64i_v(GL_SHADER_STORAGE_BUFFER_SIZE, i, &size);
    keep([=, buffer = mode_at(GL_SHADER_STORAGE_BUFFER_BINDING, i)] {
        if (buffer != 0 && size > 0)
            glBindBufferRange(GL_SHADER_STORAGE_BUFFER, i, buffer, static_cast<GLintptr>(start),
                              static_cast<GLsizeiptr>(size));
        else glBindBufferBase(GL_SHADER_STORAGE_BUFFER, i, buffer);
    });
}

KeptState::KeptState() {
    for (const GLenum what : switches) keep([=, is_on = glIsEnabled(what) == GL_TRUE] { set(what, is_on); });
    for (const GLenum store : stores) keep([=, value = value_of(store)] { glPixelStorei(store, value); });
    for (GLuint i = 0; i < count_of(GL_MAX_DRAW_BUFFERS, 8); ++i) keep_blending(i);
    for (GLuint i = 0; i < count_of(GL_MAX_VIEWPORTS, 16); ++i) keep_window(i);
    // Above all that Unseen binds to.
    for (GLuint unit = 0; unit < count_of(GL_MAX_COMBINED_TEXTURE_IMAGE_UNITS, 24); ++unit) keep_unit(unit);
    for (GLuint i = 0; i < count_of(GL_MAX_SHADER_STORAGE_BUFFER_BINDINGS, 8); ++i) keep_storage(i);
    // After the indexed ones, which set these, too.
    for (const Binding& buffer : buffers) keep([=, name = mode_of(buffer.name)] { glBindBuffer(buffer.target, name); });
    GLint polygon_modes[2] = {GL_FILL, GL_FILL}; // some drivers tell of both sides
    glGetIntegerv(GL_POLYGON_MODE, polygon_modes);
    GLboolean depth_mask = 0;
    glGetBooleanv(GL_DEPTH_WRITEMASK, &depth_mask);
    keep([=, program = mode_of(GL_CURRENT_PROGRAM), arrays = mode_of(GL_VERTEX_ARRAY_BINDING),
          drawn = mode_of(GL_DRAW_FRAMEBUFFER_BINDING), read = mode_of(GL_READ_FRAMEBUFFER_BINDING),
          origin = mode_of(GL_CLIP_ORIGIN), depth_mode = mode_of(GL_CLIP_DEPTH_MODE), depth = mode_of(GL_DEPTH_FUNC),
          culled = mode_of(GL_CULL_FACE_MODE), front = mode_of(GL_FRONT_FACE),
          polygons = static_cast<GLenum>(polygon_modes[0])] {
        glUseProgram(program);
        glBindVertexArray(arrays);
        glBindFramebuffer(GL_DRAW_FRAMEBUFFER, drawn);
        glBindFramebuffer(GL_READ_FRAMEBUFFER, read);
        glClipControl(origin, depth_mode);
        glDepthFunc(depth);
        glCullFace(culled);
        glFrontFace(front);
        glPolygonMode(GL_FRONT_AND_BACK, polygons);
        glDepthMask(depth_mask);
    });
}

} // namespace unseen::render
