#include "gpu_plane.h"

#include <algorithm>
#include <initializer_list>

#include <unseen/vdtree/internal/errors.h>

#include "gl.h"

namespace unseen::render {

glm::ivec2 texels_of(glm::ivec2 pixels) { return {(pixels.x + 3) / 4, pixels.y}; }

Result<GpuPlanes> GpuPlanes::create(glm::ivec2 pixels, int count, PlaneFormat format, const char* label) {
    const GLenum internal = format == PlaneFormat::full ? GL_RGBA32F : GL_R32F;
    const glm::ivec2 texels = format == PlaneFormat::single ? pixels : texels_of(pixels);
    GpuPlanes planes;
    planes.framebuffer_ = FramebufferObject::create(label);
    const GLuint id = planes.framebuffer_.id();
    std::vector<GLenum> drawn;
    for (int i = 0; i < count; ++i) {
        const Texture2d& texture = planes.textures_.emplace_back(Texture2d::create(label));
        glTextureStorage2D(texture.id(), 1, internal, texels.x, texels.y);
        drawn.push_back(GL_COLOR_ATTACHMENT0 + static_cast<GLenum>(i));
        glNamedFramebufferTexture(id, drawn.back(), texture.id(), 0);
    }
    const std::uint64_t texel_bytes = format == PlaneFormat::full ? 16 : 4;
    planes.bytes_ = texel_bytes * static_cast<std::uint64_t>(texels.x) * static_cast<std::uint64_t>(texels.y) *
                    static_cast<std::uint64_t>(count);
    glNamedFramebufferDrawBuffers(id, count, drawn.data());
    if (glCheckNamedFramebufferStatus(id, GL_DRAW_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
        return unsupported(
            "Pictures of " + std::to_string(pixels.x) + "x" + std::to_string(pixels.y) +
            " pixels cannot be judged on this GPU: its memory does not suffice; judge smaller pictures, or "
            "on the CPU.");
    return planes;
}

PlanePasses::PlanePasses() : no_arrays_(VertexArray::create("full screen")), nearest_(Sampler::create("nearest")) {
    glSamplerParameteri(nearest_.id(), GL_TEXTURE_MIN_FILTER, GL_NEAREST); // none of the levels that a texture lacks
    glSamplerParameteri(nearest_.id(), GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    for (const GLenum off : std::initializer_list<GLenum>{
             GL_DEPTH_TEST, GL_STENCIL_TEST, GL_BLEND, GL_CULL_FACE, GL_SCISSOR_TEST, GL_DITHER, GL_RASTERIZER_DISCARD,
             GL_COLOR_LOGIC_OP, GL_SAMPLE_ALPHA_TO_COVERAGE, GL_SAMPLE_MASK, GL_PRIMITIVE_RESTART, GL_FRAMEBUFFER_SRGB})
        glDisable(off);
    glPolygonMode(GL_FRONT_AND_BACK, GL_FILL);
    glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
    glBindVertexArray(no_arrays_.id());
}

PlanePasses::~PlanePasses() {
    for (unsigned unit = 0; unit < used_units_; ++unit) {
        glBindTextureUnit(unit, 0);
        glBindSampler(unit, 0);
    }
    glBindVertexArray(0);
}

void PlanePasses::bind(unsigned unit, unsigned texture) {
    glBindTextureUnit(unit, texture);
    if (unit < used_units_) return;
    glBindSampler(unit, nearest_.id());
    used_units_ = std::max(used_units_, unit + 1);
}

void PlanePasses::draw(const Program& program, const GpuPlanes& to, glm::ivec2 texels,
                       std::initializer_list<unsigned> textures, int first_row) {
    unsigned unit = 0;
    for (const unsigned texture : textures) bind(unit++, texture);
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, to.framebuffer());
    glViewport(0, first_row, texels.x, texels.y);
    program.use();
    glDrawArrays(GL_TRIANGLES, 0, 3);
    ++count_;
}

} // namespace unseen::render
