// Images that are laid over a surface by its texture coordinates, and what can be seen of them over a range of
// coordinates.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec4.hpp>

#include <unseen/vdtree/packed.h>
#include <unseen/vdtree/result.h>

namespace unseen::vdtree {

// RGB encoded as sRGB, and alpha.
using Texel = std::array<std::uint8_t, 4>;

// What lies beyond the coordinates 0..1: the image again, its border, or the image mirrored at every border.
enum class Wrap : std::uint32_t { repeat, clamp, mirror };

// The texel that stands for the i-th of an axis of `size` texels, where i may be any number.
std::int64_t wrapped_texel(std::int64_t i, std::int64_t size, Wrap wrap) noexcept;

// Row-major. Row 0 is where v is 0 and texel (x, y) covers u from x / width to (x + 1) / width, v likewise: images of
// formats whose v runs upward (OBJ, PLY) are stored from the bottom row, others (glTF) from the top.
struct TextureView {
    std::uint32_t width = 0, height = 0;
    Wrap wrap_u = Wrap::repeat, wrap_v = Wrap::repeat;
    std::span<const Texel> texels = {};

    bool empty() const noexcept { return texels.empty(); }
};

struct Texture {
    std::uint32_t width = 0, height = 0;
    Wrap wrap_u = Wrap::repeat, wrap_v = Wrap::repeat;
    std::vector<Texel> texels;

    TextureView view() const { return {width, height, wrap_u, wrap_v, texels}; }
};

inline constexpr std::uint32_t largest_texture_side = 16384; // texels; what graphics processors take

// An empty texture is none, and valid; else the sides must be from 1 to the largest, and the texels as many as they
// say.
Result<void> validate(const TextureView& texture);

// Linear light, 0..1, of a texel: its RGB, or its relative luminance (Rec. 709).
glm::vec4 linear_colour(Texel texel) noexcept; // with alpha
double linear_luminance(Texel texel) noexcept;

// The least box around texture coordinates; empty until something is included.
struct UvBox {
    glm::vec2 lo = glm::vec2(std::numeric_limits<float>::infinity());
    glm::vec2 hi = glm::vec2(-std::numeric_limits<float>::infinity());

    bool is_empty() const noexcept { return !(lo.x <= hi.x); }
    void include(glm::vec2 uv) noexcept {
        for (int k = 0; k < 2; ++k) {
            lo[k] = uv[k] < lo[k] ? uv[k] : lo[k];
            hi[k] = uv[k] > hi[k] ? uv[k] : hi[k];
        }
    }
    void include(const UvBox& other) noexcept {
        for (int k = 0; k < 2; ++k) {
            lo[k] = other.lo[k] < lo[k] ? other.lo[k] : lo[k];
            hi[k] = other.hi[k] > hi[k] ? other.hi[k] : hi[k];
        }
    }
    bool operator==(const UvBox&) const = default;
};

// The least and the largest luminance of a texture, and its mean, over areas of all sizes: for each of its mip levels.
class TexturePyramid {
public:
    struct Range {
        Unorm16 lo, hi; // rounded outward
        bool operator==(const Range&) const = default;
    };

    // Of a valid texture that is not empty. Cost: a pass over the texels; 11 bytes of memory for each.
    explicit TexturePyramid(const TextureView& texture);

    // What bilinear filtering can return for coordinates in the box, which may reach beyond 0..1: the range of the
    // texels there, and of others nearer than a seventh of its longer side. That of a box within another lies within
    // the other's. Coarser mip levels mix texels that are as far away as a pixel is wide. Cost: up to some hundred
    // look-ups.
    Range range(const UvBox& box) const;

    // The mean luminance over an area of this width (in texture coordinates, 0: none) around a point, about: bilinear
    // in the nearest level.
    double mean(glm::dvec2 uv, double width) const;

private:
    struct Level {
        std::uint32_t width, height;
        std::vector<Range> ranges;
        std::vector<float> means;
    };
    struct Cells { // of one axis: [first, last], and perhaps another run from 0 on
        std::int64_t first, last, second_last;
    };
    static Cells texels_of(double lo, double hi, std::uint32_t size, Wrap wrap);
    float texel_mean(const Level& level, std::int64_t x, std::int64_t y) const;
    double bilinear_mean(const Level& level, glm::dvec2 uv) const;

    std::uint32_t width_, height_;
    Wrap wrap_u_, wrap_v_;
    std::vector<Level> levels_; // 0: the texture itself
};

} // namespace unseen::vdtree
