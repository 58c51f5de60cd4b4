// Allocates targets, checking limits before and completeness after, and reads them back.
#include "target_impl.h"

#include <algorithm>

#include <unseen/vdtree/internal/errors.h>

#include "gpu_plane.h"

namespace unseen::render {
namespace {

int limit(GLenum name) {
    GLint value = 0;
    glGetIntegerv(name, &value);
    return value;
}

Result<void> check(int width, int height, const TargetOptions& options) {
    if (width < 1 || height < 1)
        return invalid_argument("A frame of " + size_text(width, height) +
                                " pixels cannot be drawn: it needs at least 1x1.");
    const int most = largest_target_side();
    if (width > most || height > most)
        return unsupported("A frame of " + size_text(width, height) +
                           " pixels cannot be drawn: this OpenGL can draw at most " + size_text(most, most) +
                           "; choose a smaller size.");
    if (options.colours.empty() && !options.depth) return invalid_argument("A target needs colours, or depth.");
    const int attachments = std::min(limit(GL_MAX_COLOR_ATTACHMENTS), limit(GL_MAX_DRAW_BUFFERS));
    if (options.colours.size() > static_cast<std::size_t>(attachments))
        return unsupported("This OpenGL draws at most " + std::to_string(attachments) + " colours into a target.");
    return {};
}

GLenum gl_format(ColourFormat format) {
    switch (format) {
    case ColourFormat::rgba32f: return GL_RGBA32F;
    case ColourFormat::srgb8: return GL_SRGB8_ALPHA8;
    case ColourFormat::shares8: return GL_RGBA8;
    }
    return GL_NONE;
}

GLenum colour_attachment(std::size_t number) { return GL_COLOR_ATTACHMENT0 + static_cast<GLenum>(number); }

bool encodes_srgb(unsigned framebuffer) {
    GLint encoding = GL_LINEAR;
    glGetNamedFramebufferAttachmentParameteriv(framebuffer, framebuffer == 0 ? GL_BACK_LEFT : GL_COLOR_ATTACHMENT0,
                                               GL_FRAMEBUFFER_ATTACHMENT_COLOR_ENCODING, &encoding);
    return encoding == GL_SRGB;
}

std::size_t pixel_count(const PixelBox& part) {
    return static_cast<std::size_t>(part.width) * static_cast<std::size_t>(part.height);
}

// GL keeps pixels in the order of its own rows.
void read(const Target::Impl& from, const PixelBox& part, GLenum format, std::size_t channels,
          std::span<float> values) {
    reset_pixel_stores();
    glBindFramebuffer(GL_READ_FRAMEBUFFER, from.id);
    const int first_row = from.top_row_first ? part.top : from.height - part.top - part.height;
    glReadPixels(part.left, first_row, part.width, part.height, format, GL_FLOAT, values.data());
    if (from.top_row_first) return;
    const auto row = static_cast<std::ptrdiff_t>(part.width) * static_cast<std::ptrdiff_t>(channels);
    for (auto top = values.begin(), bottom = values.end(); bottom - top >= 2 * row; top += row) {
        bottom -= row;
        std::swap_ranges(top, top + row, bottom);
    }
}

// Some channels of an attachment's RGBA, from the first one on.
Result<std::vector<float>> read_channels(const Target& target, int attachment, std::size_t first, std::size_t count) {
    const auto pixels = read_pixels(target, attachment);
    if (!pixels) return pixels.error();
    std::vector<float> values;
    values.reserve(pixels->size() * count);
    for (const glm::vec4& pixel : *pixels)
        for (std::size_t i = first; i < first + count; ++i) values.push_back(pixel[static_cast<int>(i)]);
    return values;
}

} // namespace

Result<void> check_part(const PixelBox& part, int width, int height, const char* what) {
    const auto lies_in = [](int first, int count, int size) {
        return first >= 0 && count >= 1 && count <= size && first <= size - count;
    };
    if (lies_in(part.left, part.width, width) && lies_in(part.top, part.height, height)) return {};
    return invalid_argument("A part of " + size_text(part.width, part.height) + " pixels from " +
                            std::to_string(part.left) + ", " + std::to_string(part.top) + " on does not lie in " +
                            what + ", which has " + size_text(width, height) + ".");
}

int largest_target_side() {
    GLint viewport[2] = {0, 0};
    glGetIntegerv(GL_MAX_VIEWPORT_DIMS, viewport);
    return std::min({limit(GL_MAX_TEXTURE_SIZE), limit(GL_MAX_RENDERBUFFER_SIZE), viewport[0], viewport[1]});
}

Result<void> Target::Impl::make(const TargetOptions& options) {
    if (auto valid = check(width, height, options); !valid) return valid;
    has_depth = options.depth;
    framebuffer = FramebufferObject::create(options.label);
    id = framebuffer.id();
    const auto attach = [&](GLenum where, GLenum format, Texture2d& texture) {
        texture = Texture2d::create(options.label);
        glTextureStorage2D(texture.id(), 1, format, width, height);
        glNamedFramebufferTexture(id, where, texture.id(), 0);
    };
    for (const ColourFormat format : options.colours) {
        attach(colour_attachment(outputs.size()), gl_format(format), colours.emplace_back());
        outputs.push_back(format == ColourFormat::srgb8 ? Output::display : Output::linear);
    }
    if (has_depth) attach(GL_DEPTH_ATTACHMENT, GL_DEPTH_COMPONENT32F, depth);
    if (outputs.empty()) {
        glNamedFramebufferDrawBuffer(id, GL_NONE);
        glNamedFramebufferReadBuffer(id, GL_NONE);
    }
    if (glCheckNamedFramebufferStatus(id, GL_DRAW_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
        return unsupported("A frame of " + size_text(width, height) +
                           " pixels cannot be drawn: the graphics memory does not suffice; "
                           "choose a smaller size.");
    return {};
}

Result<void> Target::Impl::adopt(const ForeignFramebuffer& foreign) {
    is_foreign = true;
    id = foreign.id;
    top_row_first = foreign.top_row_first;
    const GLenum status = glCheckNamedFramebufferStatus(id, GL_DRAW_FRAMEBUFFER);
    if (status == GL_FRAMEBUFFER_UNDEFINED)
        return unsupported("There is no window to draw to: the OpenGL context is headless.");
    if (status != GL_FRAMEBUFFER_COMPLETE)
        return unsupported(id == 0 ? "The window's framebuffer cannot be drawn to."
                                   : "The framebuffer cannot be drawn to: it is not complete.");
    GLint own_samples = 0;
    glGetNamedFramebufferParameteriv(id, GL_SAMPLES, &own_samples);
    samples = own_samples;
    outputs = {!foreign.is_for_display ? Output::linear : encodes_srgb(id) ? Output::display : Output::encoded};
    return {};
}

void Target::Impl::bind(int attachment, std::optional<int> mask) const {
    if (mask) {
        const GLenum both[] = {colour_attachment(static_cast<std::size_t>(attachment)),
                               colour_attachment(static_cast<std::size_t>(*mask))};
        glNamedFramebufferDrawBuffers(id, 2, both);
    } else if (!is_foreign && outputs.size() > 1) {
        glNamedFramebufferDrawBuffer(id, colour_attachment(static_cast<std::size_t>(attachment)));
    }
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, id);
}

Result<void> Target::Impl::check_attachment(int attachment) const {
    if (attachment >= 0 && static_cast<std::size_t>(attachment) < outputs.size()) return {};
    return invalid_argument("The target has no colour " + std::to_string(attachment) + ", only " +
                            std::to_string(outputs.size()) + ".");
}

// A window's samples are resolved by GL itself.
Result<void> Target::Impl::check_readable() const {
    if (samples > 0 && id != 0) return invalid_argument("A framebuffer with samples is resolved before it is read.");
    return {};
}

Result<void> Target::Impl::read_colour(int attachment, const PixelBox& part, std::span<glm::vec4> pixels) const {
    if (auto valid = check_readable(); !valid) return valid;
    if (!is_foreign) glNamedFramebufferReadBuffer(id, colour_attachment(static_cast<std::size_t>(attachment)));
    read(*this, part, GL_RGBA, 4, {&pixels[0].x, 4 * pixels.size()});
    return {};
}

Result<Target> Target::create(const Context& context, int width, int height, const TargetOptions& options) {
    auto impl = std::make_unique<Impl>(context, width, height);
    if (auto made = in_context(context, "Making a target", [&] { return impl->make(options); }); !made)
        return made.error();
    return Target(std::move(impl));
}

Result<Target> Target::foreign(const Context& context, int width, int height, const ForeignFramebuffer& framebuffer) {
    auto impl = std::make_unique<Impl>(context, width, height);
    if (auto made = in_context(context, "Drawing to the framebuffer", [&] { return impl->adopt(framebuffer); }); !made)
        return made.error();
    return Target(std::move(impl));
}

int Target::width() const noexcept { return impl_->width; }
int Target::height() const noexcept { return impl_->height; }
unsigned Target::id() const noexcept { return impl_->id; }
unsigned Target::depth_texture() const noexcept { return impl_->depth.id(); }
unsigned Target::colour_texture(int attachment) const noexcept {
    const auto number = static_cast<std::size_t>(attachment);
    return number < impl_->colours.size() ? impl_->colours[number].id() : 0;
}

Result<std::vector<glm::vec4>> read_pixels(const Target& target, int attachment, const std::optional<PixelBox>& part) {
    const Target::Impl& from = target.impl();
    const PixelBox box = part.value_or(from.whole());
    if (auto valid = from.check_attachment(attachment); !valid) return valid.error();
    if (auto valid = check_part(box, from.width, from.height, "the target"); !valid) return valid.error();
    return in_context(from.context, "Reading pixels", [&]() -> Result<std::vector<glm::vec4>> {
        std::vector<glm::vec4> pixels(pixel_count(box));
        if (auto read = from.read_colour(attachment, box, pixels); !read) return read.error();
        return pixels;
    });
}

Result<std::vector<float>> read_luminance(const Target& target, int attachment) {
    if (auto valid = target.impl().check_attachment(attachment); !valid) return valid.error();
    if (target.impl().output(attachment) != Output::linear)
        return invalid_argument("A target for displays keeps no luminance; draw into one in floats.");
    return read_channels(target, attachment, 3, 1);
}

Result<std::vector<float>> read_colour(const Target& target, int attachment) {
    return read_channels(target, attachment, 0, 3);
}

Result<std::vector<float>> read_depth(const Target& target, const std::optional<PixelBox>& part) {
    const Target::Impl& from = target.impl();
    const PixelBox box = part.value_or(from.whole());
    if (!from.has_depth) return invalid_argument("The target has no depth.");
    if (auto valid = check_part(box, from.width, from.height, "the target"); !valid) return valid.error();
    return in_context(from.context, "Reading depth", [&]() -> Result<std::vector<float>> {
        if (auto valid = from.check_readable(); !valid) return valid.error();
        std::vector<float> depth(pixel_count(box));
        read(from, box, GL_DEPTH_COMPONENT, 1, depth);
        return depth;
    });
}

} // namespace unseen::render
