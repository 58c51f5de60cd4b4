// Collects GL errors.
#include "error_log.h"

#include <exception>
#include <string_view>

#include "gl.h"

namespace unseen::render {
namespace {

// A program that goes on after errors must not fill the memory with them.
constexpr std::size_t most_messages = 32;

// A lost context may raise its flag for ever.
constexpr int most_flags = 8;

const char* flag_name(GLenum flag) {
    switch (flag) {
    case GL_INVALID_ENUM: return "GL_INVALID_ENUM";
    case GL_INVALID_VALUE: return "GL_INVALID_VALUE";
    case GL_INVALID_OPERATION: return "GL_INVALID_OPERATION";
    case GL_INVALID_FRAMEBUFFER_OPERATION: return "GL_INVALID_FRAMEBUFFER_OPERATION";
    case GL_OUT_OF_MEMORY: return "GL_OUT_OF_MEMORY";
    case GL_CONTEXT_LOST: return "GL_CONTEXT_LOST";
    default: return "an unknown GL error";
    }
}

// Remarks on speed are no errors at any severity: NVIDIA's driver sends them at medium severity for reading back a
// frame.
bool is_error(GLenum type, GLenum severity) {
    if (type == GL_DEBUG_TYPE_ERROR) return true;
    if (type == GL_DEBUG_TYPE_PERFORMANCE) return false;
    return severity == GL_DEBUG_SEVERITY_HIGH || severity == GL_DEBUG_SEVERITY_MEDIUM;
}

void APIENTRY receive(GLenum, GLenum type, GLuint, GLenum severity, GLsizei, const GLchar* text, const void* log) {
    if (!is_error(type, severity)) return;
    try {
        std::string_view message(text); // GL ends it in 0
        while (!message.empty() && message.back() == '\n') message.remove_suffix(1);
        static_cast<ErrorLog*>(const_cast<void*>(log))->add(std::string(message));
    } catch (const std::exception&) {
        // Nothing may be thrown through the driver; out of memory, the error flag still tells.
    }
}

} // namespace

void ErrorLog::attach() {
    glEnable(GL_DEBUG_OUTPUT);
    glEnable(GL_DEBUG_OUTPUT_SYNCHRONOUS); // on the thread and inside of the call that is to blame
    glDebugMessageCallback(receive, this);
    glDebugMessageControl(GL_DONT_CARE, GL_DONT_CARE, GL_DEBUG_SEVERITY_NOTIFICATION, 0, nullptr, GL_FALSE);
}

void ErrorLog::begin() {
    collect_flags();
    for (std::string& text : recent_.texts) earlier_.add(std::move(text));
    earlier_.left_out += recent_.left_out;
    recent_ = {};
}

std::string ErrorLog::take_new() {
    collect_flags();
    return recent_.take();
}

std::string ErrorLog::take_all() {
    begin();
    return earlier_.take();
}

void ErrorLog::add(std::string message) {
    recent_.add(std::move(message));
    flag_told_ = true;
}

void ErrorLog::collect_flags() {
    for (int i = 0; i < most_flags; ++i) {
        const GLenum flag = glGetError();
        if (flag == GL_NO_ERROR) break;
        if (!flag_told_) recent_.add(flag_name(flag));
    }
    flag_told_ = false;
}

void ErrorLog::Messages::add(std::string text) {
    if (texts.size() < most_messages) texts.push_back(std::move(text));
    else ++left_out;
}

std::string ErrorLog::Messages::take() {
    std::string joined;
    for (const std::string& text : texts) joined += (joined.empty() ? "" : "; ") + text;
    if (left_out > 0) joined += "; and " + std::to_string(left_out) + " more";
    texts.clear();
    left_out = 0;
    return joined;
}

} // namespace unseen::render
