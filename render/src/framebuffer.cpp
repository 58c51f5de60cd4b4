// Allocates float render targets, checking limits before and completeness after.
#include <render/framebuffer.h>

#include <algorithm>
#include <string>

#include "gl.h"

namespace unseen::render {
namespace {

int limit(GLenum name) {
    GLint value = 0;
    glGetIntegerv(name, &value);
    return value;
}

std::string size_text(int width, int height) {
    return std::to_string(width) + "x" + std::to_string(height);
}

Result<void> check_size(int width, int height) {
    if (width < 1 || height < 1)
        return Error{ErrorCode::invalid_argument,
                     "A frame of " + size_text(width, height) + " pixels cannot be drawn: it needs at least 1x1."};
    const int most = largest_framebuffer_side();
    if (width > most || height > most)
        return Error{ErrorCode::unsupported, "A frame of " + size_text(width, height) +
                                                 " pixels cannot be drawn: this OpenGL can draw at most " +
                                                 size_text(most, most) + "; choose a smaller size."};
    return {};
}

} // namespace

int largest_framebuffer_side() {
    GLint viewport[2] = {0, 0};
    glGetIntegerv(GL_MAX_VIEWPORT_DIMS, viewport);
    return std::min({limit(GL_MAX_TEXTURE_SIZE), limit(GL_MAX_RENDERBUFFER_SIZE), viewport[0], viewport[1]});
}

Result<Framebuffer> Framebuffer::create(int width, int height, const Options& options) {
    if (auto size = check_size(width, height); !size)
        return size.error();
    Framebuffer made;
    made.width_ = width;
    made.height_ = height;
    made.framebuffer_ = FramebufferObject::create(options.label);
    made.colour_ = Texture2d::create(options.label);
    glTextureStorage2D(made.colour_.id(), 1, GL_RGBA32F, width, height);
    glNamedFramebufferTexture(made.id(), GL_COLOR_ATTACHMENT0, made.colour_.id(), 0);
    if (options.depth) {
        made.depth_ = Renderbuffer::create(options.label);
        glNamedRenderbufferStorage(made.depth_.id(), GL_DEPTH_COMPONENT32F, width, height);
        glNamedFramebufferRenderbuffer(made.id(), GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, made.depth_.id());
    }
    if (glCheckNamedFramebufferStatus(made.id(), GL_DRAW_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
        return Error{ErrorCode::unsupported, "A frame of " + size_text(width, height) +
                                                 " pixels cannot be drawn: the graphics memory does not suffice; "
                                                 "choose a smaller size."};
    return made;
}

} // namespace unseen::render
