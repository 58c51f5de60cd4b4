// An image over a picture: text and marks, which are no part of what is drawn.
#pragma once

#include <memory>
#include <span>

#include <glm/gtc/type_precision.hpp>
#include <glm/vec2.hpp>

#include <unseen/render/context.h>
#include <unseen/render/target.h>
#include <unseen/vdtree/result.h>

namespace unseen::render {

// Row-major from the top left. Red, green and blue are sRGB codes, not multiplied by alpha, which is the share of the
// pixel that they cover: 0 to 255.
struct OverlayImage {
    int width = 0, height = 0; // both 0: no image
    std::span<const glm::u8vec4> pixels = {};
};

// Keeps one image on the GPU and lays it over targets, pixel upon pixel. Without an image nothing is made and nothing
// is drawn. Move-only; keeps a handle to the context.
//
//     render::Overlay label(context);
//     label.set_image({width, height, pixels});
//     draw(items, {.view = view}, window);
//     label.draw(window, {10, 10});
class Overlay {
public:
    explicit Overlay(const Context& context);
    Overlay(Overlay&&) noexcept;
    Overlay& operator=(Overlay&&) noexcept;
    ~Overlay();

    // Copied. One of the same size as the last takes the memory over; no image frees it. Fails where the pixels are not
    // width x height, and on more than this GL takes as a texture.
    Result<void> set_image(const OverlayImage& image);
    bool has_image() const noexcept;

    // `corner`: the pixel of the target under the image's top left one, from the target's top left; what lies outside
    // of the target is cut off. Mixed as light is, in linear RGB and luminance; in codes only where a framebuffer of
    // others is for display and does not encode by itself. Depth is neither asked nor changed. Fails on targets without
    // colour.
    Result<void> draw(Target& target, glm::ivec2 corner, int attachment = 0) const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

} // namespace unseen::render
