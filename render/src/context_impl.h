// What a context holds, shared by its handles.
#pragma once

#include <optional>
#include <type_traits>

#include <unseen/render/context.h>

#include "kept_state.h"
#include "program.h"

namespace unseen::render {

// Collects what GL reports as an error: debug messages and error flags.
class ErrorLog {
public:
    // Routes the current context's debug output here. The log must outlive the context and stay where it is.
    void attach();

    // From here on, new errors are told apart from earlier ones, which stay in the log for take_all().
    void begin();

    // Takes out the errors since begin(), joined by "; ", empty if there were none.
    std::string take_new();

    // Takes out everything.
    std::string take_all();

    void add(std::string message);

private:
    struct Messages {
        std::vector<std::string> texts;
        std::size_t left_out = 0;

        void add(std::string text);
        std::string take();
    };

    void collect_flags();

    Messages earlier_;
    Messages recent_;
    bool flag_told_ = false; // a debug message arrived since the flags were read, so they need not be told again
};

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
Result<std::unique_ptr<Platform>> make_foreign_platform(const std::function<void()>& make_current);
Result<std::unique_ptr<Platform>> make_glfw_platform(const WindowOptions& options);

struct Context::Impl {
    ErrorLog errors; // outlives the platform's context, which reports to it
    std::unique_ptr<Platform> platform;
    std::string renderer_name;
    std::string version;
    // Whether the GPU makes index buffers from what changes of cuts. Where the processor draws, bringing them there as a
    // whole takes less.
    bool makes_indices = true;
    Programs programs;

    Impl() = default;
    Impl(const Impl&) = delete;
    Impl& operator=(const Impl&) = delete;
    ~Impl(); // current, for the programs, which go next
};

// Makes the context current when it goes: the last member of what owns GL objects, so that these go after it.
class ContextGuard {
public:
    explicit ContextGuard(const Context& context) : context_(context) {}
    ContextGuard(const ContextGuard&) = delete;
    ContextGuard& operator=(const ContextGuard&) = delete;
    ~ContextGuard() { static_cast<void>(context_.make_current()); }

private:
    Context context_;
};

// Whether the current context has not been lost, as by a driver that was reset.
Result<void> check_alive();

template <class T>
struct AsResult {
    using Type = Result<T>;
};
template <class T>
struct AsResult<Result<T>> {
    using Type = Result<T>;
};

// Does GL work, and returns what it returns, as a Result. The error is the work's own, or else what GL reported: "`what`
// failed in OpenGL: ...".
template <class Work>
auto in_context(const Context& context, const char* what, Work&& work) {
    using Returned = std::invoke_result_t<Work>;
    using Done = typename AsResult<Returned>::Type;
    if (auto current = context.make_current(); !current) return Done(current.error());
    std::optional<KeptState> kept;
    if (context.impl().platform->is_foreign()) {
        if (auto alive = check_alive(); !alive) return Done(alive.error());
        kept.emplace();
    }
    ErrorLog& log = context.impl().errors;
    log.begin();
    Done done = [&]() -> Done {
        if constexpr (std::is_void_v<Returned>) return work(), Result<void>();
        else return work();
    }();
    const std::string errors = log.take_new();
    if (!done || errors.empty()) return done;
    return Done(Error{ErrorCode::unsupported, std::string(what) + " failed in OpenGL: " + errors + "."});
}

} // namespace unseen::render
