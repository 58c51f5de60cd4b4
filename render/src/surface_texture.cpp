// Makes mip levels and uploads them.
#include "surface_texture.h"

#include <algorithm>
#include <bit>

#include <glm/gtc/packing.hpp>

#include "gl.h"

namespace unseen::render {
namespace {

constexpr unsigned image_binding = 1, emission_binding = 3, relief_binding = 4; // of surface.frag, as the next
constexpr int lod_bias_location = 60, uv_bounds_location = 61, least_share_location = 63;
constexpr unsigned uv_location = 4;       // of surface.vert
constexpr unsigned uv_buffer_binding = 2; // of the vertex array: 0 and 1 are the vertices' and the lit ones'

// An image in linear light.
struct Level {
    int width = 0, height = 0;
    std::vector<glm::vec4> pixels; // alpha: the share of it that is there
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
            glm::vec4 sum(0);
            for (int i = 0; i < rows.count; ++i)
                for (int k = 0; k < cover.count; ++k)
                    sum += rows.shares[i] * cover.shares[k] * pixel(cover.first + k, rows.first + i);
            level.pixels.push_back(sum);
        }
    }
    return level;
}

// Rows of a level from `first` on. Drivers round what they convert to fewer channels or to half floats their own way, so
// all of them are given here.
void upload(const Texture2d& image, int number, int first, int width, int rows, std::span<const glm::vec4> pixels,
            bool has_alpha) {
    const std::size_t channels = has_alpha ? 4 : 3;
    std::vector<std::uint16_t> halves;
    halves.reserve(channels * pixels.size());
    for (const glm::vec4& pixel : pixels)
        for (std::size_t c = 0; c < channels; ++c)
            halves.push_back(glm::packHalf1x16(pixel[static_cast<glm::length_t>(c)]));
    glTextureSubImage2D(image.id(), number, 0, first, width, rows, has_alpha ? GL_RGBA : GL_RGB, GL_HALF_FLOAT,
                        halves.data());
}

// A map's texels as numbers: `value(texel)` of the finest level, `mean(texel)` of what coarser ones are means of.
template <class Value, class Mean>
void upload_all(const Texture2d& image, const vdtree::TextureView& size, std::span<const vdtree::Texel> texels,
                int levels, bool has_alpha, Value&& value, Mean&& mean) {
    const int width = static_cast<int>(size.width), height = static_cast<int>(size.height);
    const auto texel = [&](int x, int y) {
        return texels[static_cast<std::size_t>(y) * size.width + static_cast<std::size_t>(x)];
    };
    reset_pixel_stores();
    glPixelStorei(GL_UNPACK_ALIGNMENT, 2); // of half floats, three of which need not be a multiple of four bytes
    std::vector<glm::vec4> row(size.width);
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) row[static_cast<std::size_t>(x)] = value(texel(x, y));
        upload(image, 0, y, width, 1, row, has_alpha);
    }
    Level level;
    for (int number = 1; number < levels; ++number) {
        if (number == 1) level = halved(width, height, [&](int x, int y) { return mean(texel(x, y)); });
        else
            level = halved(level.width, level.height, [&](int x, int y) {
                return level.pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(level.width) +
                                    static_cast<std::size_t>(x)];
            });
        upload(image, number, 0, level.width, level.height, level.pixels, has_alpha);
    }
    reset_pixel_stores();
}

GLint gl_wrap(vdtree::Wrap wrap) {
    switch (wrap) {
    case vdtree::Wrap::clamp: return GL_CLAMP_TO_EDGE;
    case vdtree::Wrap::mirror: return GL_MIRRORED_REPEAT;
    case vdtree::Wrap::repeat: break;
    }
    return GL_REPEAT;
}

// Half floats, and not codes: decoding sRGB in hardware and drivers is off by up to a fifth of a percent, and coarse levels
// would be rounded to codes.
Result<Texture2d> create_image(const char* label, const vdtree::TextureView& texture, int levels, bool has_alpha) {
    Texture2d image = Texture2d::create(label);
    glTextureStorage2D(image.id(), levels, has_alpha ? GL_RGBA16F : GL_RGB16F, static_cast<GLsizei>(texture.width),
                       static_cast<GLsizei>(texture.height));
    if (glGetError() == GL_OUT_OF_MEMORY)
        return Error{ErrorCode::unsupported, "The graphics memory does not hold the model's texture of " +
                                                 std::to_string(texture.width) + " x " +
                                                 std::to_string(texture.height) + " texels and its coordinates."};
    glTextureParameteri(image.id(), GL_TEXTURE_MIN_FILTER, GL_LINEAR_MIPMAP_LINEAR);
    glTextureParameteri(image.id(), GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTextureParameteri(image.id(), GL_TEXTURE_WRAP_S, gl_wrap(texture.wrap_u));
    glTextureParameteri(image.id(), GL_TEXTURE_WRAP_T, gl_wrap(texture.wrap_v));
    return image;
}

} // namespace

Result<SurfaceTexture> SurfaceTexture::create(const vdtree::TextureView& texture, std::span<const glm::vec2> uvs) {
    GLint largest = 0;
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &largest);
    if (std::max(texture.width, texture.height) > static_cast<std::uint32_t>(largest))
        return Error{ErrorCode::unsupported,
                     "The graphics processor takes textures of up to " + std::to_string(largest) +
                         " texels a side, and the model's has " + std::to_string(texture.width) + " x " +
                         std::to_string(texture.height) + ": scale it down and build the tree again."};
    SurfaceTexture made;
    made.has_cut_outs_ = vdtree::has_cut_outs(texture);
    made.blends_ = texture.blends;
    for (const glm::vec2 uv : uvs) made.box_.include(uv);
    made.uvs_ = Buffer::create("texture coordinates");
    glNamedBufferStorage(made.uvs_.id(), static_cast<GLsizeiptr>(std::max<std::size_t>(uvs.size_bytes(), 1)),
                         uvs.data(), 0);
    const int levels = std::bit_width(std::max(texture.width, texture.height));
    const auto light = [](vdtree::Texel texel) { return vdtree::linear_colour(texel); };
    const auto normal = [](vdtree::Texel texel) { return glm::vec4(vdtree::relief_normal(texel), 1); };
    // The colours of what is not there are part of the means, as in other renderers: images go on under their cut-outs.
    const auto covered = [&](vdtree::Texel texel) {
        return glm::vec4(glm::vec3(vdtree::linear_colour(texel)), vdtree::coverage(texture, texel));
    };
    auto image = create_image("texture", texture, levels, made.has_cut_outs_);
    if (!image) return image.error();
    upload_all(*image, texture, texture.texels, levels, made.has_cut_outs_, light, covered);
    made.image_ = std::move(*image);
    if (!texture.emission.empty()) {
        auto map = create_image("emission", texture, levels, false);
        if (!map) return map.error();
        upload_all(*map, texture, texture.emission, levels, false, light, light);
        made.emission_ = std::move(*map);
    }
    if (!texture.relief.empty()) {
        auto map = create_image("normal map", texture, levels, false);
        if (!map) return map.error();
        upload_all(*map, texture, texture.relief, levels, false, normal, normal);
        made.relief_ = std::move(*map);
    }
    return made;
}

void SurfaceTexture::describe(unsigned vertex_array) const {
    glVertexArrayVertexBuffer(vertex_array, uv_buffer_binding, uvs_.id(), 0, sizeof(glm::vec2));
    glEnableVertexArrayAttrib(vertex_array, uv_location);
    glVertexArrayAttribFormat(vertex_array, uv_location, 2, GL_FLOAT, GL_FALSE, 0);
    glVertexArrayAttribBinding(vertex_array, uv_location, uv_buffer_binding);
}

void SurfaceTexture::bind(const Program& program, float lod_bias, float least_share) const {
    program.set(lod_bias_location, lod_bias);
    program.set(uv_bounds_location, glm::vec4(box_.lo, box_.hi)); // the least of all vertices, then the largest
    constexpr float half = 0.5f;
    if (has_cut_outs_) program.set(least_share_location, least_share < 0 && !blends_ ? half : least_share);
    const auto put = [](unsigned binding, const Texture2d& image) {
        glBindTextureUnit(binding, image.id());
        glBindSampler(binding, 0); // a window's other users may have put one there
    };
    put(image_binding, image_);
    if (emission_) put(emission_binding, emission_);
    if (relief_) put(relief_binding, relief_);
}

} // namespace unseen::render
