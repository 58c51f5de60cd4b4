// Compiles and links shader programs.
#include "program.h"

#include <glm/gtc/type_ptr.hpp>

#include <unseen/vdtree/lighting.h>

#include "shaders.h"

#include "gl.h"

namespace unseen::render {
namespace {

constexpr struct {
    GLenum kind;
    const char* name;
} stages[] = {{GL_VERTEX_SHADER, "vertex"}, // in the order of ShaderSource::Stage
              {GL_GEOMETRY_SHADER, "geometry"},
              {GL_FRAGMENT_SHADER, "fragment"},
              {GL_COMPUTE_SHADER, "compute"}};

// A shader lives until its program is linked.
class Shader {
public:
    explicit Shader(GLenum stage) : id_(glCreateShader(stage)) {}
    Shader(Shader&& other) noexcept : id_(std::exchange(other.id_, 0u)) {}
    Shader(const Shader&) = delete;
    Shader& operator=(const Shader&) = delete;
    Shader& operator=(Shader&&) = delete;
    ~Shader() { glDeleteShader(id_); } // 0 is ignored

    GLuint id() const noexcept { return id_; }

private:
    GLuint id_;
};

std::string prologue(std::span<const std::string_view> defines) {
    std::string text = "#version 450 core\n";
    for (std::string_view define : defines) {
        const bool has_value = define.find(' ') != define.npos;
        text.append("#define ").append(define).append(has_value ? "\n" : " 1\n");
    }
    return text + "#line 1\n";
}

using GetParameter = void (*)(GLuint, GLenum, GLint*);
using GetLog = void (*)(GLuint, GLsizei, GLsizei*, GLchar*);

std::string info_log(GLuint id, GetParameter get_parameter, GetLog get_log) {
    GLint size = 0;
    get_parameter(id, GL_INFO_LOG_LENGTH, &size);
    if (size <= 1) return "the compiler gives no reason";
    std::string text(static_cast<std::size_t>(size), '\0');
    GLsizei written = 0;
    get_log(id, size, &written, text.data());
    text.resize(static_cast<std::size_t>(written));
    while (!text.empty() && text.back() == '\n') text.pop_back();
    return text;
}

Error shader_error(std::string_view label, std::string_view step, const std::string& log) {
    return {ErrorCode::unsupported,
            "The shader program '" + std::string(label) + "' cannot be made: " + std::string(step) + " failed: " + log};
}

} // namespace

Result<Program> Program::build(std::string_view label, std::span<const ShaderSource> sources,
                               std::span<const std::string_view> defines) {
    const std::string first = prologue(defines);
    ProgramObject program = ProgramObject::create(label);
    std::vector<Shader> shaders;
    for (const ShaderSource& source : sources) {
        const auto& stage = stages[static_cast<std::size_t>(source.stage)];
        const Shader& shader = shaders.emplace_back(stage.kind);
        const GLchar* texts[] = {first.data(), source.text.data()};
        const GLint sizes[] = {static_cast<GLint>(first.size()), static_cast<GLint>(source.text.size())};
        glShaderSource(shader.id(), 2, texts, sizes);
        glCompileShader(shader.id());
        GLint compiled = GL_FALSE;
        glGetShaderiv(shader.id(), GL_COMPILE_STATUS, &compiled);
        if (compiled != GL_TRUE)
            return shader_error(label, std::string("compiling the ") + stage.name + " shader",
                                info_log(shader.id(), glGetShaderiv, glGetShaderInfoLog));
        glAttachShader(program.id(), shader.id());
    }
    glLinkProgram(program.id());
    for (const Shader& shader : shaders) glDetachShader(program.id(), shader.id());
    GLint linked = GL_FALSE;
    glGetProgramiv(program.id(), GL_LINK_STATUS, &linked);
    if (linked != GL_TRUE)
        return shader_error(label, "linking", info_log(program.id(), glGetProgramiv, glGetProgramInfoLog));
    return Program(std::move(program));
}

void Program::use() const { glUseProgram(id()); }
void Program::set(int location, float value) const { glProgramUniform1f(id(), location, value); }
void Program::set(int location, unsigned value) const { glProgramUniform1ui(id(), location, value); }
void Program::set(int location, glm::ivec2 value) const { glProgramUniform2i(id(), location, value.x, value.y); }
void Program::set(int location, std::span<const float> values) const {
    glProgramUniform1fv(id(), location, static_cast<GLsizei>(values.size()), values.data());
}

void Program::set(int location, const glm::vec4& value) const {
    glProgramUniform4fv(id(), location, 1, glm::value_ptr(value));
}

void Program::set(int location, std::span<const glm::vec4> values) const {
    glProgramUniform4fv(id(), location, static_cast<GLsizei>(values.size()), glm::value_ptr(values.front()));
}

void Program::set(int location, const glm::mat4& value) const {
    glProgramUniformMatrix4fv(id(), location, 1, GL_FALSE, glm::value_ptr(value));
}

void Program::set(int location, std::span<const glm::mat4> values) const {
    glProgramUniformMatrix4fv(id(), location, static_cast<GLsizei>(values.size()), GL_FALSE,
                              glm::value_ptr(values.front()));
}

// ---- the programs of a context

namespace {

Result<Program> build_surface(const ProgramKey& key) {
    std::vector<ShaderSource> sources = {{ShaderSource::Stage::vertex, shaders::surface_vert}};
    if (key.output == Output::depth) {
        if (!key.cut_out) return Program::build("depth", sources);
        sources.push_back({ShaderSource::Stage::fragment, shaders::surface_frag});
        std::vector<std::string_view> cut_out = {"TEXTURED", "CUT_OUT", "DEPTH"};
        if (key.blends) cut_out.push_back("BLENDS");
        return Program::build("depth of what is there", sources, cut_out);
    }
    std::string vertex(shaders::surface_vert), fragment(shaders::surface_frag);
    if (key.compares || key.stippled)
        fragment = "#define main surface_main\n#line 1\n" + fragment + "#undef main\n#line 1\n" +
                   std::string(key.compares ? shaders::compare_frag : shaders::stipple_frag);
    if (key.lit) {
        std::string& lit = key.relief ? fragment : vertex;
        lit = std::string(shaders::lighting_glsl) + "#line 1\n" + lit;
    }
    sources = {{ShaderSource::Stage::vertex, vertex}, {ShaderSource::Stage::fragment, fragment}};
    if (key.flat || key.wireframe) sources.push_back({ShaderSource::Stage::geometry, shaders::surface_geom});

    std::vector<std::string_view> defines;
    if (key.flat) defines.push_back("FLAT");
    if (key.wireframe) defines.push_back("WIREFRAME");
    if (key.lit) defines.push_back("LIT");
    if (key.textured) defines.push_back("TEXTURED");
    if (key.output != Output::linear) defines.push_back("DISPLAY");
    if (key.output == Output::encoded) defines.push_back("ENCODE_SRGB");
    constexpr std::string_view casting[] = {"CASTING 1", "CASTING 2", "CASTING 3", "CASTING 4"};
    static_assert(std::size(casting) == vdtree::most_shadow_lights);
    if (key.casting > 0) defines.push_back(casting[key.casting - 1]);
    if (key.mask) defines.push_back("MASK");
    if (key.cut_out) defines.push_back("CUT_OUT");
    if (key.blends) defines.push_back("BLENDS");
    if (key.emission) defines.push_back("EMISSION");
    if (key.relief) defines.push_back("RELIEF");
    if (key.share) defines.push_back("SHARE");
    return Program::build("surface", sources, defines);
}

// The key's program, built where the map has none yet.
template <class Key, class Build>
Result<const Program*> find_or_build(std::map<Key, Program>& programs, const Key& key, Build&& build) {
    auto found = programs.find(key);
    if (found == programs.end()) {
        auto built = build();
        if (!built) return built.error();
        found = programs.emplace(key, std::move(*built)).first;
    }
    return &found->second;
}

} // namespace

Result<const Program*> Programs::surface(ProgramKey key) {
    // Other looks do not change where a surface is.
    if (key.output == Output::depth)
        key = {.textured = key.cut_out, .output = Output::depth, .cut_out = key.cut_out, .blends = key.blends};
    return find_or_build(surfaces_, key, [&] { return build_surface(key); });
}

Result<const Program*> Programs::named(std::string_view label, std::span<const ShaderSource> sources,
                                       std::span<const std::string_view> defines) {
    return find_or_build(named_, label, [&] { return Program::build(label, sources, defines); });
}

Result<const Program*> Programs::full_screen(std::string_view label, std::string_view fragment,
                                             std::initializer_list<std::string_view> defines) {
    const ShaderSource sources[] = {{ShaderSource::Stage::vertex, shaders::full_screen_vert},
                                    {ShaderSource::Stage::fragment, fragment}};
    return named(label, sources, {defines.begin(), defines.size()});
}

void Programs::draw_full_screen(const Program& program) {
    if (!no_arrays_) no_arrays_ = VertexArray::create("full screen");
    program.use();
    glBindVertexArray(no_arrays_.id());
    glDrawArrays(GL_TRIANGLES, 0, 3);
    glBindVertexArray(0);
}

} // namespace unseen::render
