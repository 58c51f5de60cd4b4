// An image over a picture, such as text and marks.
#pragma once

#include <glm/gtc/type_precision.hpp>
#include <glm/vec2.hpp>

#include <unseen/render/target.h>

namespace unseen::render {

// Row-major from the top left. Red, green and blue are sRGB codes, not premultiplied; alpha is coverage, 0 to 255.
struct OverlayImage {
    int width = 0, height = 0; // both 0: no image
    std::span<const glm::u8vec4> pixels = {};
};

// Keeps one image on the GPU and draws it over targets, pixel by pixel. Costs nothing without an image. Move-only; keeps a
// handle to the context.
//
//     render::Overlay label(context);
//     label.set_image({width, height, pixels});
//     draw(items, {.view = view}, window);
//     label.draw(window, {10, 10});
class Overlay {
public:
    explicit Overlay(const Context& context);
    Overlay(Overlay&&) noexcept = default;
    Overlay& operator=(Overlay&&) noexcept = default;

    // Copies the image. One of the same size reuses the memory; an empty one frees it. Fails if there are not width x height
    // pixels, and beyond this GL's limits for textures.
    Result<void> set_image(const OverlayImage& image);
    bool has_image() const noexcept;

    // `corner`: the target's pixel under the image's top left one, from the target's top left; the image is cut off at the
    // target's borders. Blends linear RGB and luminance, or codes if a foreign framebuffer is for display and does not
    // encode by itself. Depth is neither tested nor changed. Fails on targets without colour.
    Result<void> draw(Target& target, glm::ivec2 corner, int attachment = 0) const;

private:
    struct Impl;
    std::shared_ptr<Impl> impl_;
};

} // namespace unseen::render
