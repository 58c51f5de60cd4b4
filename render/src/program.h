// A linked shader program.
#pragma once

#include <span>
#include <string_view>

#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec4.hpp>

#include <unseen/vdtree/result.h>

#include "gl_object.h"

namespace unseen::render {

// GLSL 4.50 text. Sources have no #version line, it is put first.
struct ShaderSource {
    enum class Stage { vertex, geometry, fragment, compute };
    Stage stage = Stage::vertex;
    std::string_view text;
};

// Move-only; needs a current context. Uniforms are set by their explicit layout(location = N).
class Program {
public:
    // Compiles each source with the `defines` (such as "FLAT", or "CASTING 2") before it, and links. The error is the compiler's log,
    // which counts lines as the sources do.
    static Result<Program> build(std::string_view label, std::span<const ShaderSource> sources,
                                 std::span<const std::string_view> defines = {});

    unsigned id() const noexcept { return object_.id(); }
    void use() const;

    // A location that the program does not use is an error of the caller, which the debug output reports.
    void set(int location, float value) const;
    void set(int location, unsigned value) const;
    void set(int location, glm::ivec2 value) const;
    void set(int location, const glm::vec4& value) const;
    void set(int location, std::span<const float> values) const;     // an array's first elements; not empty
    void set(int location, std::span<const glm::vec4> values) const; // an array's first elements; not empty
    void set(int location, const glm::mat4& value) const;
    void set(int location, std::span<const glm::mat4> values) const; // likewise

private:
    explicit Program(ProgramObject object) : object_(std::move(object)) {}
    ProgramObject object_;
};

} // namespace unseen::render
