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
    int samples = 8;          // a pixel, wished for; 0: exact pixels
};

struct AdoptOptions {
    // Makes the adopted context current on the thread that calls it, as by glfwMakeContextCurrent(). Called where a call
    // of Unseen finds another one, or none. None: the caller sees to it that the context is current in every call, and
    // where what lives in it ends.
    std::function<void()> make_current = {};
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

    // The context that is current on this thread, of whichever window system or toolkit. It stays its owner's, who keeps
    // it for as long as handles to it and things in it are used, and it keeps its state: what a call of Unseen changes,
    // it sets back. Errors are told by flags alone, and those that were raised before a call are kept for take_errors().
    // Fails where none is current, or it is older than 4.5 or lost. From when on it is gone, or not current and not made
    // so, calls fail with an error that says it, and nothing is deleted in another context that is current in its place.
    static Result<Context> adopt(const AdoptOptions& options = {});

    // Makes the context current again after another one was. Cheap where it already is. Everything below does it
    // itself.
    Result<void> make_current() const;

    // Waits until the GPU has done all that it was told to: for measuring times.
    Result<void> finish() const;
    // Makes the GPU begin what it was told to do: for results that are polled, where nothing swaps buffers.
    Result<void> flush() const;

    std::string renderer_name() const;        // GL_RENDERER
    std::string version() const;              // GL_VERSION
    GLFWwindow* glfw_window() const noexcept; // null when headless

    // The GL errors and debug messages since the last call, empty if all went well.
    std::string take_errors() const;

    struct Impl; // the library's own
    Impl& impl() const noexcept { return *impl_; }

private:
    explicit Context(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    static Result<Context> take(std::unique_ptr<Platform> platform);
    std::shared_ptr<Impl> impl_;
};

} // namespace unseen::render
