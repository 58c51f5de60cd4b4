// What a context holds, shared by its handles.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include <unseen/render/context.h>

#include "error_log.h"
#include "kept_state.h"
#include "programs.h"

namespace unseen::render {

// A window system's side of a context.
class Platform {
public:
    virtual ~Platform() = default;
    virtual Result<void> make_current() = 0; // does nothing where it already is
    virtual GLFWwindow* window() const noexcept { return nullptr; }
    // Somebody else's, whose state is to stay as it is.
    virtual bool is_foreign() const noexcept { return false; }
};

// GLX (under GLFW) and EGL refuse to take over a thread from each other: each lets go before the other makes current.
void release_egl_thread();
void release_glfw_thread();
void release_glx_thread(); // of whoever it is

// What is current on this thread, by EGL or GLX; null: none. Only to compare with.
void* current_native_context();

Result<std::unique_ptr<Platform>> make_egl_platform();
Result<std::unique_ptr<Platform>> make_foreign_platform(const AdoptOptions& options);
Result<std::unique_ptr<Platform>> make_glfw_platform(const WindowOptions& options);

struct Context::Impl {
    ErrorLog errors; // outlives the platform's context, which reports to it
    std::unique_ptr<Platform> platform;
    std::string renderer_name;
    std::string version;
    Programs programs;

    Impl() = default;
    Impl(const Impl&) = delete;
    Impl& operator=(const Impl&) = delete;
    ~Impl(); // current, for the programs, which go next
};

// Whether the current context has not been lost, as by a driver that was reset.
Result<void> check_alive();

// Does GL work that returns a Result<void>. The error is the work's own, or else what GL reported: "`what` failed in
// OpenGL: ...".
template <class Work>
Result<void> in_context(const Context& context, const char* what, Work&& work) {
    if (auto current = context.make_current(); !current) return current;
    std::optional<KeptState> kept;
    if (context.impl().platform->is_foreign()) {
        if (auto alive = check_alive(); !alive) return alive;
        kept.emplace();
    }
    ErrorLog& log = context.impl().errors;
    log.begin();
    Result<void> done = work();
    const std::string errors = log.take_new();
    if (!done || errors.empty()) return done;
    return Error{ErrorCode::unsupported, std::string(what) + " failed in OpenGL: " + errors + "."};
}

} // namespace unseen::render
