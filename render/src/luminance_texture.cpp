#include "luminance_texture.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include <unseen/render/target.h>
#include <unseen/vdtree/internal/errors.h>

#include "gl.h"

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

// In its context.
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

void reset_pixel_stores() {
    for (const GLenum four : std::initializer_list<GLenum>{GL_PACK_ALIGNMENT, GL_UNPACK_ALIGNMENT})
        glPixelStorei(four, 4);
    for (const GLenum zero :
         std::initializer_list<GLenum>{GL_PACK_ROW_LENGTH, GL_PACK_SKIP_ROWS, GL_PACK_SKIP_PIXELS, GL_UNPACK_ROW_LENGTH,
                                       GL_UNPACK_SKIP_ROWS, GL_UNPACK_SKIP_PIXELS})
        glPixelStorei(zero, 0);
    glBindBuffer(GL_PIXEL_PACK_BUFFER, 0);
    glBindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
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

} // namespace unseen::render
