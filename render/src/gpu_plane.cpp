#include "gpu_plane.h"

#include <algorithm>
#include <cmath>

#include <unseen/vdtree/internal/errors.h>

#include "shaders.h"

namespace unseen::render {

std::string size_text(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

Error judge_error(const std::string& message) { return invalid_argument("judge: " + message); }

Result<void> check_size(int width, int height) {
    if (width < 1 || height < 1)
        return judge_error("a picture of " + size_text(width, height) + " pixels has none; it needs at least 1x1");
    const int most = largest_target_side();
    if (width > most || height > most)
        return unsupported("judge: a picture of " + size_text(width, height) +
                           " pixels is larger than this GPU's textures, at most " + size_text(most, most) +
                           "; judge parts of it, or on the CPU");
    return {};
}

Result<void> check_texture(const LuminanceTexture& t) {
    if (auto ok = check_size(t.width, t.height); !ok) return ok;
    if (t.channel < 0 || t.channel > 3) return judge_error("a texture's channel must be 0 to 3");
    if (!(std::isfinite(t.scale) && std::isfinite(t.offset)))
        return judge_error("a texture's scale and offset must be finite");
    if (!glIsTexture(t.id)) return judge_error("there is no texture " + std::to_string(t.id) + " in this context");
    GLint target = 0, width = 0, height = 0, kind = GL_NONE;
    glGetTextureParameteriv(t.id, GL_TEXTURE_TARGET, &target);
    if (target != GL_TEXTURE_2D) return judge_error("a picture must be a texture of two dimensions, without samples");
    glGetTextureLevelParameteriv(t.id, 0, GL_TEXTURE_WIDTH, &width);
    glGetTextureLevelParameteriv(t.id, 0, GL_TEXTURE_HEIGHT, &height);
    if (width != t.width || height != t.height)
        return judge_error("the texture of a picture of " + size_text(t.width, t.height) + " pixels is " +
                           size_text(width, height));
    glGetTextureLevelParameteriv(t.id, 0, GL_TEXTURE_RED_TYPE, &kind);
    if (kind == GL_INT || kind == GL_UNSIGNED_INT || kind == GL_NONE)
        return judge_error("the texture of a picture must hold floats or normalised values");
    return {};
}

Result<void> check_picture(const LuminanceTexture& picture, glm::ivec2 size) {
    if (auto ok = check_texture(picture); !ok) return ok;
    if (picture.width == size.x && picture.height == size.y) return {};
    return judge_error("the tables are for pictures of " + size_text(size.x, size.y) + ", not " +
                       size_text(picture.width, picture.height));
}

void set_picture(const Program& program, const LuminanceTexture& picture) {
    program.set(0, glm::ivec2(picture.width, picture.height));
    program.set(1, static_cast<unsigned>(picture.channel));
    program.set(2, glm::vec4(picture.scale, picture.offset, 0, 0));
}

std::vector<float> read_floats(unsigned texture, glm::ivec2 size) {
    std::vector<float> values(static_cast<std::size_t>(size.x) * static_cast<std::size_t>(size.y));
    reset_pixel_stores();
    const std::size_t bytes = values.size() * sizeof(float);
    // GL counts bytes as an int; rows are read in parts where there are more.
    const auto row_bytes = static_cast<std::size_t>(size.x) * sizeof(float);
    const auto rows = static_cast<int>(std::min<std::size_t>(std::size_t{1} << 30, bytes) / row_bytes);
    for (int y = 0; y < size.y; y += rows) {
        const int count = std::min(rows, size.y - y);
        glGetTextureSubImage(texture, 0, 0, y, 0, size.x, count, 1, GL_RED, GL_FLOAT,
                             static_cast<GLsizei>(static_cast<std::size_t>(count) * row_bytes),
                             values.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(size.x));
    }
    return values;
}

glm::ivec2 texels_of(glm::ivec2 pixels) { return {(pixels.x + 3) / 4, pixels.y}; }

Result<void> GpuPlanes::need(glm::ivec2 pixels, int count, PlaneFormat format, const char* label) {
    if (framebuffer_) return {};
    const GLenum internal = format == PlaneFormat::full ? GL_RGBA32F : GL_R32F;
    const glm::ivec2 texels = format == PlaneFormat::single ? pixels : texels_of(pixels);
    GpuPlanes planes;
    planes.framebuffer_ = FramebufferObject::create(label);
    const GLuint id = planes.framebuffer_.id();
    std::vector<GLenum> drawn;
    for (int i = 0; i < count; ++i) {
        const Texture2d& texture = planes.textures_.emplace_back(Texture2d::create(label));
        glTextureStorage2D(texture.id(), 1, internal, texels.x, texels.y);
        drawn.push_back(GL_COLOR_ATTACHMENT0 + static_cast<GLenum>(i));
        glNamedFramebufferTexture(id, drawn.back(), texture.id(), 0);
    }
    const std::uint64_t texel_bytes = format == PlaneFormat::full ? 16 : 4;
    planes.bytes_ = texel_bytes * static_cast<std::uint64_t>(texels.x) * static_cast<std::uint64_t>(texels.y) *
                    static_cast<std::uint64_t>(count);
    glNamedFramebufferDrawBuffers(id, count, drawn.data());
    if (glCheckNamedFramebufferStatus(id, GL_DRAW_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
        return unsupported(
            "Pictures of " + std::to_string(pixels.x) + "x" + std::to_string(pixels.y) +
            " pixels cannot be judged on this GPU: its memory does not suffice; judge smaller pictures, or "
            "on the CPU.");
    *this = std::move(planes);
    return {};
}

Result<void> ThresholdMaps::check(int number) {
    if (number >= 0 && number < static_cast<int>(std::tuple_size_v<decltype(maps_)>)) return {};
    return judge_error("maps of thresholds have the numbers 0 to 15, not " + std::to_string(number));
}

Result<const GpuPlanes*> ThresholdMaps::need(int number, glm::ivec2 pixels) {
    GpuPlanes& map = maps_[static_cast<std::size_t>(number)];
    if (auto made = map.need(pixels, 1, PlaneFormat::single, "thresholds"); !made) return made.error();
    return &map;
}

unsigned ThresholdMaps::texture(int number) const noexcept {
    if (!check(number)) return 0;
    const GpuPlanes& map = maps_[static_cast<std::size_t>(number)];
    return map ? map.texture() : 0;
}

Result<std::vector<float>> ThresholdMaps::read(const Context& context, int number, glm::ivec2 pixels) const {
    const unsigned from = texture(number);
    if (from == 0) return judge_error("there is no map of thresholds yet");
    return in_context(context, "Reading thresholds", [&] { return read_floats(from, pixels); });
}

std::uint64_t ThresholdMaps::bytes() const noexcept {
    std::uint64_t bytes = 0;
    for (const GpuPlanes& map : maps_) bytes += map.bytes();
    return bytes;
}

void PlanePrograms::find(const Program*& program, std::string_view label, std::string_view fragment,
                         std::initializer_list<std::string_view> defines) {
    if (program || !result_) return;
    const auto found =
        programs_.full_screen(label, std::string(shaders::planes_glsl) + "#line 1\n" + std::string(fragment), defines);
    if (found) program = *found;
    else result_ = found.error();
}

PlanePasses::PlanePasses(Programs& programs) : programs_(programs), nearest_(Sampler::create("nearest")) {
    glSamplerParameteri(nearest_.id(), GL_TEXTURE_MIN_FILTER, GL_NEAREST); // none of the levels that a texture lacks
    glSamplerParameteri(nearest_.id(), GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    disable({GL_DEPTH_TEST, GL_STENCIL_TEST, GL_BLEND, GL_CULL_FACE, GL_SCISSOR_TEST, GL_DITHER, GL_RASTERIZER_DISCARD,
             GL_COLOR_LOGIC_OP, GL_SAMPLE_ALPHA_TO_COVERAGE, GL_SAMPLE_MASK, GL_PRIMITIVE_RESTART,
             GL_FRAMEBUFFER_SRGB});
    glPolygonMode(GL_FRONT_AND_BACK, GL_FILL);
    glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
}

PlanePasses::~PlanePasses() {
    for (unsigned unit = 0; unit < used_units_; ++unit) {
        glBindTextureUnit(unit, 0);
        glBindSampler(unit, 0);
    }
}

void PlanePasses::bind(unsigned unit, unsigned texture) {
    glBindTextureUnit(unit, texture);
    if (unit < used_units_) return;
    glBindSampler(unit, nearest_.id());
    used_units_ = std::max(used_units_, unit + 1);
}

void PlanePasses::draw(const Program& program, const GpuPlanes& to, glm::ivec2 texels,
                       std::initializer_list<unsigned> textures) {
    unsigned unit = 0;
    for (const unsigned texture : textures) bind(unit++, texture);
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, to.framebuffer());
    glViewport(0, 0, texels.x, texels.y);
    programs_.draw_full_screen(program);
    ++count_;
}

} // namespace unseen::render
