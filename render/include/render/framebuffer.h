// An off-screen render target in 32-bit float.
#pragma once

#include <render/gl_object.h>
#include <vdtree/result.h>

namespace unseen::render {

// RGBA in 32-bit float, 16 bytes a pixel, and with `depth` another 4 bytes for 32-bit float depth. Move-only; needs a
// current context.
class Framebuffer {
public:
    struct Options {
        bool depth = true;
        const char* label = "";
    };

    Framebuffer() = default; // holds nothing

    // Fails on a size below 1x1 or above what this GL can draw to, and when memory runs out.
    static Result<Framebuffer> create(int width, int height, const Options& options);

    unsigned id() const noexcept { return framebuffer_.id(); }
    unsigned colour_texture() const noexcept { return colour_.id(); }
    int width() const noexcept { return width_; }
    int height() const noexcept { return height_; }

private:
    FramebufferObject framebuffer_;
    Texture2d colour_;
    Renderbuffer depth_;
    int width_ = 0;
    int height_ = 0;
};

// The largest window that this GL can draw to, in pixels a side.
int largest_framebuffer_side();

} // namespace unseen::render
