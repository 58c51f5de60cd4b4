// Contexts of others: known by what EGL or GLX say is current.
#include <atomic>

#include <dlfcn.h>

#include <unseen/vdtree/internal/errors.h>

#include <EGL/egl.h>

#include "context_impl.h"

namespace unseen::render {
namespace {

// A function of GLX, which is asked only where somebody has loaded it: nothing here needs it. It may be loaded later.
template <class Function>
Function glx_function(const char* name) {
    for (const char* library : {"libGLX.so.0", "libGL.so.1"})
        if (void* const loaded = dlopen(library, RTLD_LAZY | RTLD_NOLOAD))
            if (void* const found = dlsym(loaded, name)) return reinterpret_cast<Function>(found);
    return nullptr;
}

void* current_glx_context() {
    using GetCurrent = void* (*)();
    static std::atomic<GetCurrent> known = nullptr;
    if (!known) known = glx_function<GetCurrent>("glXGetCurrentContext");
    const GetCurrent get = known;
    return get ? get() : nullptr;
}

class ForeignPlatform final : public Platform {
public:
    ForeignPlatform(void* context, const std::function<void()>& make_current)
        : context_(context), make_current_(make_current) {}

    Result<void> make_current() override {
        if (current_native_context() == context_) return {};
        if (!make_current_)
            return unsupported("The adopted OpenGL context is not current on this thread; make it current before the "
                               "call, or give Context::adopt() a function that does so.");
        // EGL and GLX do not take over a thread from each other: ours let go.
        release_egl_thread();
        release_glfw_thread();
        make_current_();
        if (current_native_context() == context_) return {};
        return unsupported("The adopted OpenGL context is not current on this thread after its function was called: is "
                           "it gone, or current on another thread?");
    }
    bool is_foreign() const noexcept override { return true; }

private:
    void* context_;
    std::function<void()> make_current_;
};

} // namespace

void release_glx_thread() {
    if (!current_glx_context()) return;
    const auto get_display = glx_function<void* (*)()>("glXGetCurrentDisplay");
    const auto make_current = glx_function<int (*)(void*, unsigned long, void*)>("glXMakeCurrent");
    if (get_display && make_current) make_current(get_display(), 0, nullptr);
}

void* current_native_context() {
    // By EGL, of desktop OpenGL; what is current for OpenGL ES is kept apart.
    const EGLenum api = eglQueryAPI();
    if (api != EGL_OPENGL_API) eglBindAPI(EGL_OPENGL_API);
    void* const by_egl = eglGetCurrentContext();
    if (api != EGL_OPENGL_API && api != EGL_NONE) eglBindAPI(api);
    return by_egl ? by_egl : current_glx_context();
}

Result<std::unique_ptr<Platform>> make_foreign_platform(const std::function<void()>& make_current) {
    void* const context = current_native_context();
    if (!context || !glGetString(GL_VERSION))
        return unsupported(
            "There is no OpenGL context to adopt: make yours current on this thread before. (OpenGL ES is "
            "another API.)");
    return std::unique_ptr<Platform>(std::make_unique<ForeignPlatform>(context, make_current));
}

} // namespace unseen::render
