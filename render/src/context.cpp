// Contexts, whatever the window system: takes the platform's and turns its debug output into errors.
#include <unseen/render/context.h>

#include <exception>
#include <string_view>

#include "context_impl.h"

namespace unseen::render {
namespace {

// A program that goes on after errors must not fill the memory with them.
constexpr std::size_t most_messages = 32;

// A lost context may raise its flag for ever.
constexpr int most_flags = 8;

const char* flag_name(GLenum flag) {
    switch (flag) {
    case GL_INVALID_ENUM: return "GL_INVALID_ENUM";
    case GL_INVALID_VALUE: return "GL_INVALID_VALUE";
    case GL_INVALID_OPERATION: return "GL_INVALID_OPERATION";
    case GL_INVALID_FRAMEBUFFER_OPERATION: return "GL_INVALID_FRAMEBUFFER_OPERATION";
    case GL_OUT_OF_MEMORY: return "GL_OUT_OF_MEMORY";
    case GL_CONTEXT_LOST: return "GL_CONTEXT_LOST";
    default: return "an unknown GL error";
    }
}

// Remarks on speed are no errors at any severity: NVIDIA's driver sends them at medium severity for reading back a
// frame.
bool is_error(GLenum type, GLenum severity) {
    if (type == GL_DEBUG_TYPE_ERROR) return true;
    if (type == GL_DEBUG_TYPE_PERFORMANCE) return false;
    return severity == GL_DEBUG_SEVERITY_HIGH || severity == GL_DEBUG_SEVERITY_MEDIUM;
}

void APIENTRY receive(GLenum, GLenum type, GLuint, GLenum severity, GLsizei, const GLchar* text, const void* log) {
    if (!is_error(type, severity)) return;
    try {
        std::string_view message(text); // GL ends it in 0
        while (!message.empty() && message.back() == '\n') message.remove_suffix(1);
        static_cast<ErrorLog*>(const_cast<void*>(log))->add(std::string(message));
    } catch (const std::exception&) {
        // Nothing may be thrown through the driver; out of memory, the error flag still tells.
    }
}

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
    const auto draws = [&](const char* renderer) { return impl->renderer_name.find(renderer) != std::string::npos; };
    impl->makes_indices = !draws("llvmpipe") && !draws("softpipe") && !draws("SwiftShader");
    if (auto enough = check_version(impl->version); !enough) return enough.error();
    // Debug output of others stays theirs.
    if (!impl->platform->is_foreign()) impl->errors.attach();
    return Context(std::move(impl));
}

Result<Context> Context::adopt(const std::function<void()>& make_current) {
    auto platform = make_foreign_platform(make_current);
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

Result<void> Context::finish() const { return in_context(*this, "Waiting for the GPU", glFinish); }

Result<void> Context::flush() const { return in_context(*this, "Handing work to the GPU", glFlush); }

std::string Context::renderer_name() const { return impl_->renderer_name; }

std::string Context::version() const { return impl_->version; }

GLFWwindow* Context::glfw_window() const noexcept { return impl_->platform->window(); }

std::string Context::take_errors() const {
    if (auto current = make_current(); !current) return current.error().message;
    return impl_->errors.take_all();
}

// ---- errors

void ErrorLog::attach() {
    glEnable(GL_DEBUG_OUTPUT);
    glEnable(GL_DEBUG_OUTPUT_SYNCHRONOUS); // on the thread and inside of the call that is to blame
    glDebugMessageCallback(receive, this);
    glDebugMessageControl(GL_DONT_CARE, GL_DONT_CARE, GL_DEBUG_SEVERITY_NOTIFICATION, 0, nullptr, GL_FALSE);
}

void ErrorLog::begin() {
    collect_flags();
    for (std::string& text : recent_.texts) earlier_.add(std::move(text));
    earlier_.left_out += recent_.left_out;
    recent_ = {};
}

std::string ErrorLog::take_new() {
    collect_flags();
    return recent_.take();
}

std::string ErrorLog::take_all() {
    begin();
    return earlier_.take();
}

void ErrorLog::add(std::string message) {
    recent_.add(std::move(message));
    flag_told_ = true;
}

void ErrorLog::collect_flags() {
    for (int i = 0; i < most_flags; ++i) {
        const GLenum flag = glGetError();
        if (flag == GL_NO_ERROR) break;
        if (!flag_told_) recent_.add(flag_name(flag));
    }
    flag_told_ = false;
}

void ErrorLog::Messages::add(std::string text) {
    if (texts.size() < most_messages) texts.push_back(std::move(text));
    else ++left_out;
}

std::string ErrorLog::Messages::take() {
    std::string joined;
    for (const std::string& text : texts) joined += (joined.empty() ? "" : "; ") + text;
    if (left_out > 0) joined += "; and " + std::to_string(left_out) + " more";
    texts.clear();
    left_out = 0;
    return joined;
}

} // namespace unseen::render
