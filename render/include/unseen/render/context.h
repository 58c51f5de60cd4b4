// An OpenGL 4.5 core context: headless through EGL, or a GLFW window. Drawing code is the same under both.
#pragma once

#include <functional>
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
    int samples = 8;          // hardware samples a pixel, if available; 0: no multisampling
};

// A handle; copies are the same context. Every GPU object keeps a handle to its context, so the context and its window live
// as long as the last of them. Belongs to the thread that made it, where it stays current until another one is made or
// used. GL debug output of severity medium and high is collected as errors, except for performance hints; see
// take_errors().
class Context {
public:
    // EGL without a display: enumerated devices first (to find a GPU), then the surfaceless platform (software rendering).
    // Fails if there is neither.
    static Result<Context> headless();

    // A GLFW window, sRGB-capable and multisampled if possible. On the main thread only; the caller polls events and swaps
    // buffers. Fails without a display.
    static Result<Context> window(const WindowOptions& options = {});

    // The context that is current on this thread, from any window system or toolkit. It stays its owner's, who must keep it
    // as long as handles to it and objects in it are used. Every call restores the GL state that it changes. GL errors are
    // read from flags alone; errors from before a call are kept for take_errors(). Fails if no context is current, or if it
    // is older than 4.5 or lost. Once it is gone, or not current and cannot be made so, calls fail with an error that says
    // so, and nothing is deleted in another context that is current in its place.
    //
    // `make_current` makes the adopted context current on the calling thread, such as glfwMakeContextCurrent(). It is called
    // when the context is not current. If empty, the caller must make the context current before every call, and before
    // destroying what lives in it.
    static Result<Context> adopt(const std::function<void()>& make_current = {});

    // Makes the context current again. Cheap if it already is. All functions of this library do so themselves.
    Result<void> make_current() const;

    // Waits until the GPU has finished all commands. For measuring times.
    Result<void> finish() const;
    // Makes the GPU begin what it was told to do: for results that are polled, where nothing swaps buffers.
    Result<void> flush() const;

    std::string renderer_name() const;        // GL_RENDERER
    std::string version() const;              // GL_VERSION
    GLFWwindow* glfw_window() const noexcept; // null when headless

    // GL errors and debug messages since the last call; empty if there were none.
    std::string take_errors() const;

    struct Impl; // the library's own
    Impl& impl() const noexcept { return *impl_; }

private:
    explicit Context(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    static Result<Context> take(std::unique_ptr<Platform> platform);
    std::shared_ptr<Impl> impl_;
};

} // namespace unseen::render
