// Planes of numbers that passes read and write, four of a row in each texel (shaders/planes.glsl).
#pragma once

#include <cstdint>
#include <initializer_list>
#include <vector>

#include <glm/vec2.hpp>

#include <unseen/vdtree/result.h>

#include "gl_object.h"
#include "program.h"

namespace unseen::render {

enum class PlaneFormat {
    full,   // four 32-bit floats a texel
    single, // one 32-bit float: a pixel a texel
};

// One plane, or two that one pass writes at once. Needs a current context.
class GpuPlanes {
public:
    GpuPlanes() noexcept = default;
    // Planes of this many pixels. Fails if memory runs out.
    static Result<GpuPlanes> create(glm::ivec2 pixels, int count, PlaneFormat format, const char* label);

    unsigned framebuffer() const noexcept { return framebuffer_.id(); }
    unsigned texture(std::size_t number = 0) const noexcept { return textures_[number].id(); }
    explicit operator bool() const noexcept { return static_cast<bool>(framebuffer_); }
    std::uint64_t bytes() const noexcept { return bytes_; } // of all planes

private:
    std::uint64_t bytes_ = 0;
    std::vector<Texture2d> textures_;
    FramebufferObject framebuffer_;
};

// The texels that hold this many pixels.
glm::ivec2 texels_of(glm::ivec2 pixels);

// What passes of planes share: nothing is blended, tested or cut off, and textures are read as they are. Textures that are
// bound in it are bound for the passes alone.
class PlanePasses {
public:
    PlanePasses();
    ~PlanePasses();
    PlanePasses(const PlanePasses&) = delete;
    PlanePasses& operator=(const PlanePasses&) = delete;

    // Binds the textures from unit 0 on, and computes `texels` of the planes from the given row on.
    void draw(const Program& program, const GpuPlanes& to, glm::ivec2 texels, std::initializer_list<unsigned> textures,
              int first_row = 0);
    void bind(unsigned unit, unsigned texture);
    int count() const noexcept { return count_; } // of draws

private:
    int count_ = 0;
    VertexArray no_arrays_; // for the full-screen triangle, which comes from nowhere
    Sampler nearest_;
    unsigned used_units_ = 0;
};

} // namespace unseen::render
