// Window contexts through GLFW.

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include "context_impl.h"

namespace unseen::render {
namespace {

// Set by the first window. GLFW is the process's: another user of it may have windows too, so it is never terminated
// here.
bool glfw_started = false;

std::string glfw_reason() {
    const char* text = nullptr;
    const int code = glfwGetError(&text);
    return code == GLFW_NO_ERROR ? "no reason given" : text;
}

Error no_window(const std::string& what) {
    return {ErrorCode::unsupported, what + ": " + glfw_reason() + "; is there a display (DISPLAY)?"};
}

void set_hints(const WindowOptions& options) {
    glfwDefaultWindowHints();
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 4);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 5);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_OPENGL_DEBUG_CONTEXT, GLFW_TRUE);
    glfwWindowHint(GLFW_SRGB_CAPABLE, GLFW_TRUE);
    glfwWindowHint(GLFW_SAMPLES, options.samples); // fewer, or none, are fine
    glfwWindowHint(GLFW_VISIBLE, options.visible ? GLFW_TRUE : GLFW_FALSE);
}

class GlfwPlatform final : public Platform {
public:
    explicit GlfwPlatform(GLFWwindow* window) : window_(window) {}
    GlfwPlatform(const GlfwPlatform&) = delete;
    GlfwPlatform& operator=(const GlfwPlatform&) = delete;
    ~GlfwPlatform() override { glfwDestroyWindow(window_); } // lets go of the context, too

    GLFWwindow* window() const noexcept override { return window_; }

    Result<void> make_current() override {
        if (glfwGetCurrentContext() == window_) return {};
        release_egl_thread();
        glfwGetError(nullptr); // an older error is not ours
        glfwMakeContextCurrent(window_);
        if (glfwGetCurrentContext() != window_)
            return no_window("The window's OpenGL context cannot be made current on this thread");
        return {};
    }

private:
    GLFWwindow* window_;
};

} // namespace

void release_glfw_thread() {
    if (glfw_started && glfwGetCurrentContext()) glfwMakeContextCurrent(nullptr);
}

Result<std::unique_ptr<Platform>> make_glfw_platform(const WindowOptions& options) {
    if (options.width < 1 || options.height < 1)
        return Error{ErrorCode::invalid_argument, "A window of " + std::to_string(options.width) + "x" +
                                                      std::to_string(options.height) +
                                                      " pixels cannot be opened: it needs at least 1x1."};
    if (!glfwInit()) return no_window("No window can be opened");
    glfw_started = true;
    set_hints(options);
    GLFWmonitor* monitor = options.full_screen ? glfwGetPrimaryMonitor() : nullptr;
    const GLFWvidmode* mode = monitor ? glfwGetVideoMode(monitor) : nullptr;
    GLFWwindow* window = glfwCreateWindow(mode ? mode->width : options.width, mode ? mode->height : options.height,
                                          options.title.c_str(), mode ? monitor : nullptr, nullptr);
    if (!window) return no_window("No window with an OpenGL 4.5 context can be opened");
    auto platform = std::make_unique<GlfwPlatform>(window);
    if (auto current = platform->make_current(); !current) return current.error();
    return std::unique_ptr<Platform>(std::move(platform));
}

} // namespace unseen::render
