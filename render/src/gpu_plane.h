// Planes of numbers that passes read and write, four of a row in each texel (shaders/planes.glsl).
#pragma once

#include <array>

#include <glm/vec2.hpp>

#include <unseen/render/internal/visibility_passes.h>

#include "context_impl.h"

namespace unseen::render {

// What passes over pictures share: what a picture may be, and reading back.
std::string size_text(int width, int height);
Error judge_error(const std::string& message);

// In its context.
Result<void> check_size(int width, int height);
Result<void> check_texture(const LuminanceTexture& texture);
// The same, and that it has the size that the tables of passes are for.
Result<void> check_picture(const LuminanceTexture& picture, glm::ivec2 size);
// For shaders that read a picture: its size, channel, scale and offset, at the first locations.
void set_picture(const Program& program, const LuminanceTexture& picture);

// Reads the first channel. Waits for the GPU.
std::vector<float> read_floats(unsigned texture, glm::ivec2 size);

enum class PlaneFormat {
    full,   // four 32-bit floats a texel
    single, // one 32-bit float: a pixel a texel
};

// One plane, or two that one pass writes at once. Needs a current context.
class GpuPlanes {
public:
    // Makes planes of this many pixels where there are none yet. Fails if memory runs out.
    Result<void> need(glm::ivec2 pixels, int count, PlaneFormat format, const char* label);

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

// Maps of just visible steps of luminance, by number, 0 to 15. In their context.
class ThresholdMaps {
public:
    static Result<void> check(int number);

    Result<const GpuPlanes*> need(int number, glm::ivec2 pixels); // made where it is not there yet
    unsigned texture(int number) const noexcept;                  // 0: there is none yet
    Result<std::vector<float>> read(const Context& context, int number, glm::ivec2 pixels) const; // makes it current
    std::uint64_t bytes() const noexcept;

private:
    std::array<GpuPlanes, 16> maps_;
};

// What passes of planes share: nothing is blended, tested or cut off, and textures are read as they are. Textures that are
// bound in it are bound for the passes alone.
class PlanePasses {
public:
    explicit PlanePasses(Programs& programs);
    ~PlanePasses();
    PlanePasses(const PlanePasses&) = delete;
    PlanePasses& operator=(const PlanePasses&) = delete;

    // Binds the textures from unit 0 on, and computes `texels` of the planes.
    void draw(const Program& program, const GpuPlanes& to, glm::ivec2 texels, std::initializer_list<unsigned> textures);
    void bind(unsigned unit, unsigned texture);
    int count() const noexcept { return count_; } // of draws

private:
    int count_ = 0;
    Programs& programs_;
    Sampler nearest_;
    unsigned used_units_ = 0;
};

// Programs by name, found when they are first needed; the first error is kept. planes.glsl comes before their texts.
class PlanePrograms {
public:
    explicit PlanePrograms(const Context& context) : programs_(context.impl().programs) {}

    void find(const Program*& program, std::string_view label, std::string_view fragment,
              std::initializer_list<std::string_view> defines = {});
    const Result<void>& result() const { return result_; }

private:
    Programs& programs_;
    Result<void> result_;
};

} // namespace unseen::render
