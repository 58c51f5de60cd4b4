// Targets: framebuffers to draw into and to read back.
#pragma once

#include <optional>

#include <glm/vec4.hpp>

#include <unseen/render/context.h>

namespace unseen::render {

enum class ColourFormat {
    rgba32f, // linear RGB and relative luminance in a; 16 bytes a pixel
    srgb8,   // for displays: encoded as sRGB, a is 1
    shares8, // four numbers from 0 to 1 in steps of 1/255, for shadow masks
};

// 32-bit float depth is 1 at the near plane and 0 at infinity.
struct TargetOptions {
    std::vector<ColourFormat> colours = {ColourFormat::rgba32f}; // the attachments; may be empty
    bool depth = true;
    const char* label = "";
};

// A framebuffer of the caller's, which must outlive the target.
struct ForeignFramebuffer {
    unsigned id = 0;            // 0: the window's
    bool is_for_display = true; // colours are encoded as sRGB, by the framebuffer or by the shaders; a is 1
    bool top_row_first = false; // the order of rows in memory
};

// A part of a picture: pixels from its top left.
struct PixelBox {
    int left = 0, top = 0, width = 0, height = 0;
};

// The luminance of a picture on the GPU, cd/m2: offset + scale * (a channel of a two-dimensional texture, floats or
// normalised, whose first row is the picture's top). Example: {target.colour_texture(), width, height, 3, peak - black,
// black}.
struct LuminanceTexture {
    unsigned id = 0; // GL name; the texture stays its owner's
    int width = 0, height = 0;
    int channel = 0; // 0 to 3
    float scale = 1, offset = 0;
};

// Move-only. Owns its attachments and a handle to its context.
class Target {
public:
    // Fails on a size below 1x1 or beyond this GL's limits, and if memory runs out.
    static Result<Target> create(const Context& context, int width, int height, const TargetOptions& options = {});

    // Wraps the window's back buffer, or another framebuffer. Fails if it cannot be drawn to.
    static Result<Target> foreign(const Context& context, int width, int height,
                                  const ForeignFramebuffer& framebuffer = {});

    Target(Target&&) noexcept = default;
    Target& operator=(Target&&) noexcept = default;

    int width() const noexcept;
    int height() const noexcept;

    // GL names, for drawing of your own. 0 if there is none.
    unsigned id() const noexcept;
    unsigned colour_texture(int attachment = 0) const noexcept;
    unsigned depth_texture() const noexcept;

    struct Impl; // the library's own
    Impl& impl() const noexcept { return *impl_; }

private:
    explicit Target(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    std::shared_ptr<Impl> impl_;
};

// Read a target back, row-major from the top left; waits for the GPU. Fail on foreign framebuffers with samples, and
// without such an attachment. `part`: a box within the target; default: all of it.
Result<std::vector<glm::vec4>> read_pixels(const Target& target, int attachment = 0,
                                           const std::optional<PixelBox>& part = {});
Result<std::vector<float>> read_luminance(const Target& target, int attachment = 0); // not of targets for displays
Result<std::vector<float>> read_colour(const Target& target, int attachment = 0);    // three values a pixel
Result<std::vector<float>> read_depth(const Target& target, const std::optional<PixelBox>& part = {});

// The largest size that this GL can draw to, pixels a side. Needs a current context.
int largest_target_side();

} // namespace unseen::render
