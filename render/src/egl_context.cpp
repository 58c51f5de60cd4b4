// Headless contexts through EGL: hardware devices, then software devices, then Mesa's surfaceless platform.
#include <algorithm>

#include <unseen/vdtree/internal/errors.h>

#include <EGL/egl.h>
#include <EGL/eglext.h>

#include "context_impl.h"

namespace unseen::render {
namespace {

const char* egl_error_name(EGLint error) {
    switch (error) {
    case EGL_SUCCESS: return "no reason given";
    case EGL_NOT_INITIALIZED: return "EGL_NOT_INITIALIZED";
    case EGL_BAD_ACCESS: return "EGL_BAD_ACCESS";
    case EGL_BAD_ALLOC: return "EGL_BAD_ALLOC";
    case EGL_BAD_ATTRIBUTE: return "EGL_BAD_ATTRIBUTE";
    case EGL_BAD_CONFIG: return "EGL_BAD_CONFIG";
    case EGL_BAD_CONTEXT: return "EGL_BAD_CONTEXT";
    case EGL_BAD_CURRENT_SURFACE: return "EGL_BAD_CURRENT_SURFACE";
    case EGL_BAD_DISPLAY: return "EGL_BAD_DISPLAY";
    case EGL_BAD_MATCH: return "EGL_BAD_MATCH";
    case EGL_BAD_PARAMETER: return "EGL_BAD_PARAMETER";
    case EGL_CONTEXT_LOST: return "EGL_CONTEXT_LOST";
    default: return "an unknown EGL error";
    }
}

std::string failed(std::string_view step) {
    return std::string(step) + " failed (" + egl_error_name(eglGetError()) + ")";
}

bool has_extension(const char* list, std::string_view name) {
    const std::string_view all = list ? list : "";
    for (std::size_t start = 0; start < all.size();) {
        const std::size_t end = std::min(all.find(' ', start), all.size());
        if (all.substr(start, end - start) == name) return true;
        start = end + 1;
    }
    return false;
}

template <class Function>
Function egl_function(const char* name) {
    return reinterpret_cast<Function>(eglGetProcAddress(name));
}

// A place to look for OpenGL.
struct Candidate {
    EGLenum platform = 0;
    void* native = nullptr; // an EGLDeviceEXT, or the default display
    std::string name;
};

const char* client_extensions() { return eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS); }

std::vector<EGLDeviceEXT> devices() {
    const char* extensions = client_extensions();
    if (!has_extension(extensions, "EGL_EXT_device_base") && !has_extension(extensions, "EGL_EXT_device_enumeration"))
        return {};
    const auto query = egl_function<PFNEGLQUERYDEVICESEXTPROC>("eglQueryDevicesEXT");
    EGLint count = 0;
    if (!query || !query(0, nullptr, &count) || count <= 0) return {};
    std::vector<EGLDeviceEXT> found(static_cast<std::size_t>(count));
    if (!query(count, found.data(), &count)) return {};
    found.resize(static_cast<std::size_t>(count));
    return found;
}

bool is_software(EGLDeviceEXT device) {
    const auto query = egl_function<PFNEGLQUERYDEVICESTRINGEXTPROC>("eglQueryDeviceStringEXT");
    return query && has_extension(query(device, EGL_EXTENSIONS), "EGL_MESA_device_software");
}

std::vector<Candidate> candidates() {
    std::vector<Candidate> hardware, software;
    const bool can_open = has_extension(client_extensions(), "EGL_EXT_platform_device");
    int number = 0;
    for (EGLDeviceEXT device : can_open ? devices() : std::vector<EGLDeviceEXT>{}) {
        const std::string name = "EGL device " + std::to_string(number++);
        if (is_software(device)) software.push_back({EGL_PLATFORM_DEVICE_EXT, device, name + " (software)"});
        else hardware.push_back({EGL_PLATFORM_DEVICE_EXT, device, name});
    }
    std::vector<Candidate> all = std::move(hardware);
    all.insert(all.end(), software.begin(), software.end());
    if (has_extension(client_extensions(), "EGL_MESA_platform_surfaceless"))
        all.push_back({EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, "Mesa's surfaceless platform"});
    return all;
}

// EGL displays belong to the process and are shared with other users of EGL: they are initialised, but never terminated,
// which would end the others' contexts. Context and surface are ours.
class EglPlatform final : public Platform {
public:
    // Fails with the reason if the candidate has no context.
    Result<void> open(const Candidate& candidate) {
        const auto get_display = egl_function<PFNEGLGETPLATFORMDISPLAYEXTPROC>("eglGetPlatformDisplayEXT");
        if (!get_display) return unsupported("EGL has no platform displays");
        display_ = get_display(candidate.platform, candidate.native, nullptr);
        EGLint major = 0, minor = 0;
        if (display_ == EGL_NO_DISPLAY || !eglInitialize(display_, &major, &minor))
            return unsupported(failed("initialising"));
        if (!eglBindAPI(EGL_OPENGL_API)) return unsupported(failed("choosing desktop OpenGL"));
        if (auto config = choose_config(); !config) return config;

        const EGLint context_attributes[] = {EGL_CONTEXT_MAJOR_VERSION,
                                             4,
                                             EGL_CONTEXT_MINOR_VERSION,
                                             5,
                                             EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                             EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                             EGL_CONTEXT_OPENGL_DEBUG,
                                             EGL_TRUE,
                                             EGL_NONE};
        context_ = eglCreateContext(display_, config_, EGL_NO_CONTEXT, context_attributes);
        if (context_ == EGL_NO_CONTEXT) return unsupported(failed("making an OpenGL 4.5 core context"));
        if (!has_extension(eglQueryString(display_, EGL_EXTENSIONS), "EGL_KHR_surfaceless_context")) {
            const EGLint size[] = {EGL_WIDTH, 1, EGL_HEIGHT, 1, EGL_NONE};
            surface_ = eglCreatePbufferSurface(display_, config_, size);
            if (surface_ == EGL_NO_SURFACE) return unsupported(failed("making a pixel buffer"));
        }
        return make_current();
    }

    EglPlatform() = default;
    EglPlatform(const EglPlatform&) = delete;
    EglPlatform& operator=(const EglPlatform&) = delete;

    ~EglPlatform() override {
        if (context_ != EGL_NO_CONTEXT) {
            if (eglGetCurrentContext() == context_) release_egl_thread();
            eglDestroyContext(display_, context_);
        }
        if (surface_ != EGL_NO_SURFACE) eglDestroySurface(display_, surface_);
    }

    Result<void> make_current() override {
        eglBindAPI(EGL_OPENGL_API); // current contexts are kept by thread and by API
        if (eglGetCurrentContext() == context_) return {};
        release_glfw_thread();
        release_glx_thread();
        if (!eglMakeCurrent(display_, surface_, surface_, context_))
            return unsupported(failed("making the OpenGL context current on this thread"));
        return {};
    }

private:
    Result<void> choose_config() {
        const EGLint wanted[] = {EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
        EGLint count = 0;
        if (!eglChooseConfig(display_, wanted, &config_, 1, &count))
            return unsupported(failed("choosing a configuration"));
        if (count == 0) return unsupported("it has no configuration for desktop OpenGL");
        return {};
    }

    EGLDisplay display_ = EGL_NO_DISPLAY;
    EGLConfig config_ = nullptr;
    EGLContext context_ = EGL_NO_CONTEXT;
    EGLSurface surface_ = EGL_NO_SURFACE; // a pixel buffer where EGL cannot do without
};

} // namespace

void release_egl_thread() {
    const EGLDisplay display = eglGetCurrentDisplay();
    if (display != EGL_NO_DISPLAY) eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
}

Result<std::unique_ptr<Platform>> make_egl_platform() {
    std::string reasons;
    for (const Candidate& candidate : candidates()) {
        auto platform = std::make_unique<EglPlatform>();
        const auto opened = platform->open(candidate);
        if (opened) return std::unique_ptr<Platform>(std::move(platform));
        reasons += (reasons.empty() ? "" : "; ") + candidate.name + ": " + opened.error().message;
    }
    if (reasons.empty()) reasons = "EGL offers neither devices nor the surfaceless platform";
    return unsupported("No OpenGL 4.5 device found (" + reasons +
                       "); install a graphics driver, or libgl1-mesa-dri and libegl-mesa0 for software rendering.");
}

} // namespace unseen::render
