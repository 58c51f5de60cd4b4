// Makes mip levels and uploads them.
#include "surface_texture.h"

#include <algorithm>
#include <bit>

#include "gl.h"

namespace unseen::render {
namespace {

constexpr unsigned image_binding = 1;     // of surface.frag
constexpr unsigned uv_location = 4;       // of surface.vert
constexpr unsigned uv_buffer_binding = 2; // of the vertex array: 0 and 1 are the vertices' and the lit ones'

// An image in linear light.
struct Level {
    int width = 0, height = 0;
    std::vector<glm::vec3> pixels;
};

// The parts of `fine` cells that one of `coarse` covers, two or three.
struct Cover {
    int first = 0, count = 0;
    float shares[3] = {};
};

Cover cover_of(int cell, int fine, int coarse) {
    const double begin = static_cast<double>(cell) * fine / coarse, end = static_cast<double>(cell + 1) * fine / coarse;
    Cover cover;
    cover.first = static_cast<int>(begin);
    for (int i = cover.first; i < fine && i < end && cover.count < 3; ++i) {
        const double share = std::min<double>(end, i + 1) - std::max<double>(begin, i);
        if (share > 0) cover.shares[cover.count++] = static_cast<float>(share / (end - begin));
    }
    return cover;
}

// `pixel(x, y)` gives those of the finer level.
template <class Pixel>
Level halved(int width, int height, Pixel&& pixel) {
    Level level{std::max(1, width / 2), std::max(1, height / 2), {}};
    level.pixels.reserve(static_cast<std::size_t>(level.width) * static_cast<std::size_t>(level.height));
    std::vector<Cover> columns;
    for (int x = 0; x < level.width; ++x) columns.push_back(cover_of(x, width, level.width));
    for (int y = 0; y < level.height; ++y) {
        const Cover rows = cover_of(y, height, level.height);
        for (const Cover& cover : columns) {
            glm::vec3 sum(0);
            for (int i = 0; i < rows.count; ++i)
                for (int k = 0; k < cover.count; ++k)
                    sum += rows.shares[i] * cover.shares[k] * pixel(cover.first + k, rows.first + i);
            level.pixels.push_back(sum);
        }
    }
    return level;
}

void upload_all(const Texture2d& image, const vdtree::TextureView& texture, int levels) {
    const int width = static_cast<int>(texture.width), height = static_cast<int>(texture.height);
    const auto texel = [&](int x, int y) {
        return glm::vec3(vdtree::linear_colour(
            texture.texels[static_cast<std::size_t>(y) * texture.width + static_cast<std::size_t>(x)]));
    };
    reset_pixel_stores();
    std::vector<glm::vec3> row(texture.width);
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) row[static_cast<std::size_t>(x)] = texel(x, y);
        glTextureSubImage2D(image.id(), 0, 0, y, width, 1, GL_RGB, GL_FLOAT, row.data());
    }
    Level level;
    for (int number = 1; number < levels; ++number) {
        if (number == 1) level = halved(width, height, texel);
        else
            level = halved(level.width, level.height, [&](int x, int y) {
                return level.pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(level.width) +
                                    static_cast<std::size_t>(x)];
            });
        glTextureSubImage2D(image.id(), number, 0, 0, level.width, level.height, GL_RGB, GL_FLOAT, level.pixels.data());
    }
}

GLint gl_wrap(vdtree::Wrap wrap) {
    switch (wrap) {
    case vdtree::Wrap::clamp: return GL_CLAMP_TO_EDGE;
    case vdtree::Wrap::mirror: return GL_MIRRORED_REPEAT;
    case vdtree::Wrap::repeat: break;
    }
    return GL_REPEAT;
}

} // namespace

Result<SurfaceTexture> SurfaceTexture::create(const vdtree::TextureView& texture, std::span<const glm::vec2> uvs) {
    GLint largest = 0;
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &largest);
    const std::string size = std::to_string(texture.width) + " x " + std::to_string(texture.height);
    if (std::max(texture.width, texture.height) > static_cast<std::uint32_t>(largest))
        return Error{ErrorCode::unsupported, "The graphics processor takes textures of up to " +
                                                 std::to_string(largest) + " texels a side, and the model's has " +
                                                 size + ": scale it down and build the tree again."};
    SurfaceTexture made;
    for (const glm::vec2 uv : uvs) made.box_.include(uv);
    made.uvs_ = Buffer::create("texture coordinates");
    glNamedBufferStorage(made.uvs_.id(), static_cast<GLsizeiptr>(std::max<std::size_t>(uvs.size_bytes(), 1)),
                         uvs.data(), 0);
    made.image_ = Texture2d::create("texture");
    const auto levels = static_cast<GLsizei>(std::bit_width(std::max(texture.width, texture.height)));
    // Linear light, and not sRGB codes: their decoding in hardware and drivers is off by up to a fifth of a percent,
    // and coarse levels would be rounded to codes.
    glTextureStorage2D(made.image_.id(), levels, GL_RGB16F, static_cast<GLsizei>(texture.width),
                       static_cast<GLsizei>(texture.height));
    if (glGetError() == GL_OUT_OF_MEMORY)
        return Error{ErrorCode::unsupported, "The graphics memory does not hold the model's texture of " + size +
                                                 " texels and its coordinates."};
    upload_all(made.image_, texture, levels);
    glTextureParameteri(made.image_.id(), GL_TEXTURE_MIN_FILTER, GL_LINEAR_MIPMAP_LINEAR);
    glTextureParameteri(made.image_.id(), GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTextureParameteri(made.image_.id(), GL_TEXTURE_WRAP_S, gl_wrap(texture.wrap_u));
    glTextureParameteri(made.image_.id(), GL_TEXTURE_WRAP_T, gl_wrap(texture.wrap_v));
    return made;
}

void SurfaceTexture::describe(unsigned vertex_array) const {
    glVertexArrayVertexBuffer(vertex_array, uv_buffer_binding, uvs_.id(), 0, sizeof(glm::vec2));
    glEnableVertexArrayAttrib(vertex_array, uv_location);
    glVertexArrayAttribFormat(vertex_array, uv_location, 2, GL_FLOAT, GL_FALSE, 0);
    glVertexArrayAttribBinding(vertex_array, uv_location, uv_buffer_binding);
}

void SurfaceTexture::bind() const {
    glBindTextureUnit(image_binding, image_.id());
    glBindSampler(image_binding, 0); // a window's other users may have put one there
}

} // namespace unseen::render
