// A texture of the image, and a pass over the pixels that it covers.
#include <unseen/render/internal/overlay.h>

#include <algorithm>

#include <unseen/vdtree/internal/errors.h>

#include "gpu_plane.h"
#include "shaders.h"
#include "surface_pass.h"

namespace unseen::render {
namespace {

constexpr unsigned image_unit = 0; // of overlay.frag
constexpr int place_location = 0, kind_location = 1;

Result<void> check(const OverlayImage& image) {
    if (image.width < 0 || image.height < 0 || (image.width == 0) != (image.height == 0))
        return invalid_argument("An image to lay over a picture cannot have " + size_text(image.width, image.height) +
                                " pixels.");
    if (image.pixels.size() != static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height))
        return invalid_argument("An image of " + size_text(image.width, image.height) + " pixels does not come as " +
                                std::to_string(image.pixels.size()) + " of them.");
    GLint most = 0;
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &most);
    if (image.width <= most && image.height <= most) return {};
    return unsupported("An image of " + size_text(image.width, image.height) +
                       " pixels cannot be laid over a picture: this OpenGL takes " + std::to_string(most) + " a side.");
}

// What of the image lies in the target, in the target's own rows.
PixelBox visible_box(const Target::Impl& target, glm::ivec2 corner, int width, int height) {
    const auto clipped = [](int first, int count, int all) {
        // A corner far outside must not overflow.
        const auto end = std::clamp<long long>(static_cast<long long>(first) + count, 0, all);
        return std::pair(std::clamp(first, 0, all), static_cast<int>(end));
    };
    const auto [left, right] = clipped(corner.x, width, target.width);
    const auto [top, bottom] = clipped(corner.y, height, target.height);
    return {left, target.top_row_first ? top : target.height - bottom, std::max(0, right - left),
            std::max(0, bottom - top)};
}

unsigned kind_of(Output output) { return output == Output::linear ? 0 : output == Output::display ? 1 : 2; }

} // namespace

struct Overlay::Impl {
    explicit Impl(const Context& context_) : context(context_), guard(context_) {}

    Result<void> take(const OverlayImage& image) {
        if (auto valid = check(image); !valid) return valid;
        if (!texture || image.width != width || image.height != height) {
            width = height = 0;
            texture = {}; // the old one first, so that both need not fit at a time
            if (image.pixels.empty()) return {};
            texture = Texture2d::create("overlay");
            glTextureStorage2D(texture.id(), 1, GL_RGBA8, image.width, image.height);
            width = image.width;
            height = image.height;
        }
        reset_pixel_stores();
        glTextureSubImage2D(texture.id(), 0, 0, 0, width, height, GL_RGBA, GL_UNSIGNED_BYTE, image.pixels.data());
        return {};
    }

    Result<void> draw(const Target::Impl& target, glm::ivec2 corner, int attachment) const {
        const PixelBox box = visible_box(target, corner, width, height);
        if (box.width == 0 || box.height == 0) return {};
        Programs& programs = context.impl().programs;
        const auto program = programs.full_screen("overlay", shaders::overlay_frag);
        if (!program) return program.error();

        const Output output = target.output(attachment);
        set_fixed_state(target);
        set_scissor(box);
        disable({GL_DEPTH_TEST, GL_CULL_FACE});
        glEnable(GL_BLEND);
        glBlendEquation(GL_FUNC_ADD);
        glBlendFunc(GL_ONE, GL_ONE_MINUS_SRC1_ALPHA);
        if (output == Output::display) glEnable(GL_FRAMEBUFFER_SRGB); // and so GL decodes, mixes and encodes
        target.bind(attachment);
        (*program)->set(place_location, glm::vec4(corner.x, corner.y, target.height, target.top_row_first ? 1 : 0));
        (*program)->set(kind_location, kind_of(output));
        glBindTextureUnit(image_unit, texture.id());
        glBindSampler(image_unit, 0); // a window's other users may have put one there
        programs.draw_full_screen(**program);
        disable({GL_BLEND, GL_SCISSOR_TEST});
        return {};
    }

    Context context; // first, and so gone last
    int width = 0, height = 0;
    Texture2d texture;
    ContextGuard guard;
};

Overlay::Overlay(const Context& context) : impl_(std::make_unique<Impl>(context)) {}

bool Overlay::has_image() const noexcept { return static_cast<bool>(impl_->texture); }

Result<void> Overlay::set_image(const OverlayImage& image) {
    return in_context(impl_->context, "Taking an image to lay over a picture", [&] { return impl_->take(image); });
}

Result<void> Overlay::draw(Target& target, glm::ivec2 corner, int attachment) const {
    const Target::Impl& to = target.impl();
    if (&to.context.impl() != &impl_->context.impl())
        return invalid_argument("The overlay belongs to another OpenGL context than the target.");
    if (auto valid = to.check_attachment(attachment); !valid) return valid;
    if (!has_image()) return {};
    return in_context(impl_->context, "Drawing an overlay", [&] { return impl_->draw(to, corner, attachment); });
}

} // namespace unseen::render
