// Linked shader programs, and those of a context.
#pragma once

#include <compare>
#include <map>
#include <span>

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

// Where a surface's colours go.
enum class Output {
    linear,  // as they are, with the luminance in a
    display, // opaque; the framebuffer encodes them
    encoded, // opaque, encoded as sRGB by the shader
    depth,   // nowhere: only depth is drawn
};

struct ProgramKey {
    bool lit = false, textured = false, flat = false, wireframe = false;
    Output output = Output::linear;
    bool compares = false;                 // drops pixels that look like a picture: compare.frag
    bool stippled = false;                 // drops pixels of a pattern: stipple.frag; not of what compares
    int casting = 0;                       // lights that cast shadows, and are drawn with them
    bool mask = false;                     // writes the shadows' mask as well
    bool cut_out = false;                  // drops pixels whose texels are not there; of depth, too
    bool blends = false;                   // of these, by shares that are the texels' alpha
    bool emission = false, relief = false; // maps that a texture has
    bool share = false;                    // writes which share of its light comes to a surface, and nothing else
    auto operator<=>(const ProgramKey&) const = default;
};

// Programs stay where they are as long as this does. Needs a current context for everything.
class Programs {
public:
    Result<const Program*> surface(ProgramKey key);

    // The one program of this label, a literal.
    Result<const Program*> named(std::string_view label, std::span<const ShaderSource> sources,
                                 std::span<const std::string_view> defines = {});

    // A fragment shader's program for all pixels of a target, and its drawing.
    Result<const Program*> full_screen(std::string_view label, std::string_view fragment,
                                       std::initializer_list<std::string_view> defines = {});
    void draw_full_screen(const Program& program);

private:
    std::map<ProgramKey, Program> surfaces_;
    std::map<std::string_view, Program> named_;
    VertexArray no_arrays_; // for the full-screen triangle, which comes from nowhere
};

} // namespace unseen::render
