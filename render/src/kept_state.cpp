#include "kept_state.h"

#include <algorithm>

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
GLint value_at(GLenum name, GLuint index) {
    GLint value = 0;
    glGetIntegeri_v(name, index, &value);
    return value;
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

KeptState::KeptState() {
    for (const GLenum what : switches) switches_.push_back(glIsEnabled(what) == GL_TRUE);
    for (const GLenum store : stores) stores_.push_back(value_of(store));
    for (const Binding& buffer : buffers) buffers_.push_back(value_of(buffer.name));
    for (GLuint i = 0; i < count_of(GL_MAX_DRAW_BUFFERS, most_draw_buffers); ++i) {
        Blend blend{value_at(GL_BLEND_SRC_RGB, i),        value_at(GL_BLEND_DST_RGB, i),
                    value_at(GL_BLEND_SRC_ALPHA, i),      value_at(GL_BLEND_DST_ALPHA, i),
                    value_at(GL_BLEND_EQUATION_RGB, i),   value_at(GL_BLEND_EQUATION_ALPHA, i),
                    glIsEnabledi(GL_BLEND, i) == GL_TRUE, {}};
        glGetBooleani_v(GL_COLOR_WRITEMASK, i, blend.mask.data());
        blends_.push_back(blend);
    }
    for (GLuint i = 0; i < count_of(GL_MAX_VIEWPORTS, most_viewports); ++i) {
        Window window{};
        glGetFloati_v(GL_VIEWPORT, i, window.viewport.data());
        glGetIntegeri_v(GL_SCISSOR_BOX, i, window.scissor.data());
        glGetDoublei_v(GL_DEPTH_RANGE, i, window.depth_range.data());
        window.is_scissored = glIsEnabledi(GL_SCISSOR_TEST, i) == GL_TRUE;
        windows_.push_back(window);
    }
    for (GLuint unit = 0; unit < count_of(GL_MAX_COMBINED_TEXTURE_IMAGE_UNITS, unit_count); ++unit) {
        textures_.emplace_back();
        for (const GLenum binding : texture_bindings)
            if (const GLint texture = value_at(binding, unit); texture != 0) textures_.back().push_back(texture);
        samplers_.push_back(value_at(GL_SAMPLER_BINDING, unit));
    }
    for (GLuint i = 0; i < count_of(GL_MAX_SHADER_STORAGE_BUFFER_BINDINGS, storage_count); ++i) {
        Storage storage{value_at(GL_SHADER_STORAGE_BUFFER_BINDING, i), 0, 0};
        glGetInteger64i_v(GL_SHADER_STORAGE_BUFFER_START, i, &storage.start);
        glGetInteger64i_v(GL_SHADER_STORAGE_BUFFER_SIZE, i, &storage.size);
        storages_.push_back(storage);
    }
    program_ = value_of(GL_CURRENT_PROGRAM);
    vertex_array_ = value_of(GL_VERTEX_ARRAY_BINDING);
    draw_framebuffer_ = value_of(GL_DRAW_FRAMEBUFFER_BINDING);
    read_framebuffer_ = value_of(GL_READ_FRAMEBUFFER_BINDING);
    clip_origin_ = value_of(GL_CLIP_ORIGIN);
    clip_depth_ = value_of(GL_CLIP_DEPTH_MODE);
    depth_function_ = value_of(GL_DEPTH_FUNC);
    cull_face_ = value_of(GL_CULL_FACE_MODE);
    front_face_ = value_of(GL_FRONT_FACE);
    GLint modes[2] = {GL_FILL, GL_FILL}; // some drivers tell of both sides
    glGetIntegerv(GL_POLYGON_MODE, modes);
    polygon_mode_ = modes[0];
    glGetBooleanv(GL_DEPTH_WRITEMASK, &depth_mask_);
}

KeptState::~KeptState() {
    const auto name = [](GLint value) { return static_cast<GLuint>(value); };
    const auto mode = [](GLint value) { return static_cast<GLenum>(value); };
    for (std::size_t i = 0; i < switches_.size(); ++i) set(switches[i], switches_[i]);
    for (std::size_t i = 0; i < stores_.size(); ++i) glPixelStorei(stores[i], stores_[i]);
    for (GLuint i = 0; i < blends_.size(); ++i) {
        const Blend& blend = blends_[i];
        set_at(GL_BLEND, i, blend.is_on);
        glBlendFuncSeparatei(i, mode(blend.source_rgb), mode(blend.target_rgb), mode(blend.source_alpha),
                             mode(blend.target_alpha));
        glBlendEquationSeparatei(i, mode(blend.rgb), mode(blend.alpha));
        glColorMaski(i, blend.mask[0], blend.mask[1], blend.mask[2], blend.mask[3]);
    }
    for (GLuint i = 0; i < windows_.size(); ++i) {
        const Window& window = windows_[i];
        glViewportIndexedfv(i, window.viewport.data());
        glScissorIndexedv(i, window.scissor.data());
        glDepthRangeIndexed(i, window.depth_range[0], window.depth_range[1]);
        set_at(GL_SCISSOR_TEST, i, window.is_scissored);
    }
    for (GLuint unit = 0; unit < textures_.size(); ++unit) {
        glBindTextureUnit(unit, 0);
        for (const GLint texture : textures_[unit]) glBindTextureUnit(unit, name(texture));
        glBindSampler(unit, name(samplers_[unit]));
    }
    for (GLuint i = 0; i < storages_.size(); ++i) {
        const Storage& storage = storages_[i];
        if (storage.buffer != 0 && storage.size > 0)
            glBindBufferRange(GL_SHADER_STORAGE_BUFFER, i, name(storage.buffer), static_cast<GLintptr>(storage.start),
                              static_cast<GLsizeiptr>(storage.size));
        else glBindBufferBase(GL_SHADER_STORAGE_BUFFER, i, name(storage.buffer));
    }
    // After the indexed ones, which set these, too.
    for (std::size_t i = 0; i < buffers_.size(); ++i) glBindBuffer(buffers[i].target, name(buffers_[i]));
    glUseProgram(name(program_));
    glBindVertexArray(name(vertex_array_));
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, name(draw_framebuffer_));
    glBindFramebuffer(GL_READ_FRAMEBUFFER, name(read_framebuffer_));
    glClipControl(mode(clip_origin_), mode(clip_depth_));
    glDepthFunc(mode(depth_function_));
    glCullFace(mode(cull_face_));
    glFrontFace(mode(front_face_));
    glPolygonMode(GL_FRONT_AND_BACK, mode(polygon_mode_));
    glDepthMask(depth_mask_);
}

} // namespace unseen::render
