// An OpenGL 4.5 core context: headless through EGL, or a GLFW window. Drawing code is the same under both.
#pragma once

#include <memory>
#include <string>
#include <utility>

#include <unseen/vdtree/result.h>

struct GLFWwindow;

namespace unseen::render {

class Platform;

struct WindowOptions {
    int width = 1024;
    int height = 1024;
    std::string title = "Unseen";
    bool visible = true;
    bool full_screen = false; // the primary monitor as it is, whatever the size
    int samples = 8;          // a pixel, wished for; 0: exact pixels
};

// A handle: copies are the same context. All that lives in it on the GPU keeps one, so the context, and its window, end
// with the last of them. Current on the thread that made it until another one is made or used there; stays on that
// thread. GL debug output of severity medium and high is collected as errors, see take_errors(); remarks on performance
// are not.
class Context {
public:
    // EGL without a display: enumerated devices first (so that a GPU is found), then the surfaceless platform
    // (software rendering works). Fails with a clear error where there is neither.
    static Result<Context> headless();

    // A window of GLFW's, sRGB-capable and multisampled where there is such a thing. On the main thread only; the
    // caller polls events and swaps buffers. Fails where there is no display.
    static Result<Context> window(const WindowOptions& options = {});

    // Makes the context current again after another one was. Cheap where it already is. Everything below does it
    // itself.
    Result<void> make_current() const;

    // Waits until the GPU has done all that it was told to: for measuring times.
    Result<void> finish() const;

    std::string renderer_name() const;        // GL_RENDERER
    std::string version() const;              // GL_VERSION
    GLFWwindow* glfw_window() const noexcept; // null when headless

    // The GL errors and debug messages since the last call, empty if all went well.
    std::string take_errors() const;

    struct Impl; // the library's own
    Impl& impl() const noexcept { return *impl_; }

private:
    explicit Context(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    static Result<Context> adopt(std::unique_ptr<Platform> platform);
    std::shared_ptr<Impl> impl_;
};

} // namespace unseen::render
