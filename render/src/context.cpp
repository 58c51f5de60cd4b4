// Contexts, whatever the window system: takes the platform's and turns its debug output into errors.
#include <unseen/render/context.h>

#include "context_impl.h"
#include "gl.h"
#include "gl_object.h"

namespace unseen::render {
namespace {

std::string gl_text(GLenum name) {
    const auto* text = reinterpret_cast<const char*>(glGetString(name));
    return text ? text : "unknown";
}

Result<void> check_version(const std::string& version) {
    GLint major = 0, minor = 0;
    glGetIntegerv(GL_MAJOR_VERSION, &major);
    glGetIntegerv(GL_MINOR_VERSION, &minor);
    if (major > 4 || (major == 4 && minor >= 5)) return {};
    return Error{ErrorCode::unsupported, "OpenGL 4.5 is needed, but the driver gives only " + version + "."};
}

} // namespace

Context::Impl::~Impl() {
    if (platform) let_objects_go(platform->make_current().has_value());
}

Result<Context> Context::headless() {
    auto platform = make_egl_platform();
    if (!platform) return platform.error();
    return take(std::move(*platform));
}

Result<Context> Context::window(const WindowOptions& options) {
    auto platform = make_glfw_platform(options);
    if (!platform) return platform.error();
    return take(std::move(*platform));
}

Result<Context> Context::take(std::unique_ptr<Platform> platform) {
    auto impl = std::make_shared<Impl>();
    impl->platform = std::move(platform);
    impl->version = gl_text(GL_VERSION);
    impl->renderer_name = gl_text(GL_RENDERER);
    if (auto enough = check_version(impl->version); !enough) return enough.error();
    // Debug output of others stays theirs.
    if (!impl->platform->is_foreign()) impl->errors.attach();
    return Context(std::move(impl));
}

Result<Context> Context::adopt(const AdoptOptions& options) {
    auto platform = make_foreign_platform(options);
    if (!platform) return platform.error();
    if (auto alive = check_alive(); !alive) return alive.error();
    return take(std::move(*platform));
}

// What goes next may be deleted in this context, or else lives in one that is out of reach.
Result<void> Context::make_current() const {
    Result<void> current = impl_->platform->make_current();
    let_objects_go(current.has_value());
    return current;
}

Result<void> check_alive() {
    switch (glGetGraphicsResetStatus()) {
    case GL_NO_ERROR: return {};
    case GL_GUILTY_CONTEXT_RESET:
        return Error{ErrorCode::unsupported, "The OpenGL context was lost by a call made in it; make another one."};
    default:
        return Error{ErrorCode::unsupported,
                     "The OpenGL context was lost when the driver was reset; make another one."};
    }
}

Result<void> Context::finish() const {
    return in_context(*this, "Waiting for the GPU", []() -> Result<void> {
        glFinish();
        return {};
    });
}

Result<void> Context::flush() const {
    return in_context(*this, "Handing work to the GPU", []() -> Result<void> {
        glFlush();
        return {};
    });
}

std::string Context::renderer_name() const { return impl_->renderer_name; }

std::string Context::version() const { return impl_->version; }

GLFWwindow* Context::glfw_window() const noexcept { return impl_->platform->window(); }

std::string Context::take_errors() const {
    if (auto current = make_current(); !current) return current.error().message;
    return impl_->errors.take_all();
}

} // namespace unseen::render
