// What a context holds, shared by its handles and by what draws in it.
#pragma once

#include <memory>
#include <string>

#include <render/context.h>

#include "error_log.h"

namespace unseen::render {

// A window system's side of a context.
class Platform {
public:
    virtual ~Platform() = default;
    virtual Result<void> make_current() = 0; // does nothing where it already is
    virtual GLFWwindow* window() const noexcept { return nullptr; }
};

// GLX (under GLFW) and EGL refuse to take over a thread from each other: each lets go before the other makes current.
void release_egl_thread();
void release_glfw_thread();

Result<std::unique_ptr<Platform>> make_egl_platform();
Result<std::unique_ptr<Platform>> make_glfw_platform(const WindowOptions& options);

struct Context::Impl {
    ErrorLog errors; // outlives the platform's context, which reports to it
    std::unique_ptr<Platform> platform;
    std::string renderer_name;
    std::string version;
};

} // namespace unseen::render
