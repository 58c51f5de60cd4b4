// An OpenGL 4.5 core context: headless through EGL, or a GLFW window. Drawing code is the same under both.
#pragma once

#include <memory>
#include <string>

#include <vdtree/result.h>

struct GLFWwindow;

namespace unseen::render {

struct WindowOptions {
    int width = 1024;
    int height = 1024;
    std::string title = "Unseen";
    bool visible = true;
};

// Move-only; current on the thread that made it, for as long as it lives. GL debug output of severity medium and high is
// collected as errors, see take_errors().
class Context {
public:
    // EGL without a display: enumerated devices first (so that a GPU is found), then the surfaceless platform
    // (software rendering works). Fails with a clear error where there is neither.
    static Result<Context> headless();
    static Result<Context> window(const WindowOptions& options = {});

    Context(Context&&) noexcept;
    Context& operator=(Context&&) noexcept;
    ~Context();

    std::string renderer_name() const; // GL_RENDERER
    std::string version() const;       // GL_VERSION
    GLFWwindow* glfw_window() const noexcept; // null when headless

    // The GL errors and debug messages since the last call, empty if all went well.
    std::string take_errors();

private:
    struct Impl;
    explicit Context(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

} // namespace unseen::render
