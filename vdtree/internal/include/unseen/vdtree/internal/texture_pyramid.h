// What can be seen of a texture over a range of coordinates.
#pragma once

#include <limits>

#include <unseen/vdtree/mesh.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

// The texel that stands for texel i, any number, of an axis of `size` texels.
std::int64_t wrapped_texel(std::int64_t i, std::int64_t size, Wrap wrap) noexcept;

// A texel in linear light, 0..1: its RGB and alpha, or its relative luminance (Rec. 709).
glm::vec4 linear_colour(Texel texel) noexcept;
double linear_luminance(Texel texel) noexcept;

// The share of light that a texel stops.
inline float coverage(const TextureView& texture, Texel texel) noexcept {
    return texture.blends ? static_cast<float>(texel[3]) / 255 : texel[3] >= 128 ? 1.0f : 0.0f;
}
bool has_cut_outs(const TextureView& texture) noexcept; // texels of which this is below 1

// x, y, z of a texel of a normal map, from -1 to 1: glTF's code 128 is none.
glm::vec3 relief_normal(Texel texel) noexcept;

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

// Where a texture is seen through.
class CutOuts {
public:
    // Precondition: a valid texture. Cost: a pass over the texels; 4 bytes of memory for each, if any is not there.
    explicit CutOuts(const TextureView& texture);

    bool is_empty() const noexcept { return sums_.empty(); }
    // Whether there are any in the box or beside it; true for boxes that reach beyond 0..1, if there are any at all.
    bool any(const UvBox& box) const;

private:
    std::uint32_t width_, height_;
    std::vector<std::uint32_t> sums_; // above and to the left of each texel's corners
};

// The least and the largest luminance of a texture, and its mean, over areas of all sizes: for each of its mip levels.
class TexturePyramid {
public:
    // Precondition: a valid texture that is not empty. Cost: a pass over the texels; 11 bytes of memory for each.
    explicit TexturePyramid(const TextureView& texture);

    // Contains what bilinear filtering can return for coordinates in the box, which may reach beyond 0..1: the range of
    // the texels there, and of others nearer than a seventh of its longer side. A box within another has a range within
    // the other's. Coarser mip levels mix texels as far away as a pixel is wide. Cost: up to some hundred look-ups.
    PackedRange range(const UvBox& box) const;

    // About the mean luminance over an area of this width (texture coordinates, 0 or more) around a point: bilinear in the
    // nearest level.
    double mean(glm::dvec2 uv, double width) const;

private:
    struct Level {
        std::uint32_t width, height;
        std::vector<PackedRange> ranges; // rounded outward
        std::vector<float> means;
    };
    struct Cells { // along one axis: [first, last], and perhaps another run from 0 on
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
