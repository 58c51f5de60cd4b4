// A texture as the measurement of folds looks at it: its relative luminance by mip level, how much contrast lies at
// which level around a place, what it makes of vertices, and how densely it lies on the surface.
#pragma once

#include <unseen/perception/internal/chroma.h>
#include <unseen/vdtree/internal/simd.h>
#include <unseen/vdtree/internal/texture_pyramid.h>
#include <unseen/vdtree/vertex_tree.h>

#include "measure/shown_texels.h"

namespace unseen::perception {

// Level l has texels 2^l times as wide as the texture's own. What a level shows and the next one does not is its
// detail: patterns of about four of its texels a wave.
class TextureDetail {
public:
    // On vertices of this colour (linear RGB; its brightness does not count). Cost: some passes over the texels; 6 bytes of
    // memory for each.
    explicit TextureDetail(const ShownTexels& texels, glm::vec3 tint = glm::vec3(1));

    // Likewise, what the texture shows of one primary: 0 red, 1 green, 2 blue. Without contrasts.
    static TextureDetail of_primary(const ShownTexels& texels, int primary);

    // In place of images that are not known: noise of this mean, of measurement::usual_contrast in
    // each octave. Cost: some passes over its texels.
    static TextureDetail stand_in(float mean);

    std::size_t level_count() const { return levels_.size(); }
    glm::vec2 size() const { return glm::vec2(width_, height_); } // texels

    // The mean luminance of a level's texels, bilinear, as renderers filter; beyond 0..1 as the texture repeats.
    float at(std::size_t level, glm::vec2 uv) const;
    // Likewise, but of the nearest texel. There must be such a level.
    float nearest(std::size_t level, glm::vec2 uv) const;
    // The level whose texels are the first to be no narrower than so many of the texture's own.
    std::size_t level_of(float texels) const;

    // The largest detail of a level in the box and nearby, as a contrast: over the local mean of the next level and
    // about a display's black.
    float contrast(std::size_t level, const vdtree::UvBox& box) const;

    // Raises the contrasts by what the primaries of the same texture differ in colour.
    void include_colours(std::span<const std::shared_ptr<const TextureDetail>> primaries);

private:
    struct Tiles { // of some texels a side, the largest contrast in each
        std::uint32_t width, height;
        std::vector<float> largest;
    };
    struct Level {
        std::uint32_t width, height;
        std::vector<float> means;
        std::vector<Tiles> tiles; // each half as fine as the last
    };
    struct Run { // of texels
        std::int64_t first, last;
    };

    TextureDetail() = default;
    template <class Value>
    void set_levels(const vdtree::TextureView& size, Value&& value); // value(texel): of the finest
    void find_contrasts(std::size_t level, std::span<const std::shared_ptr<const TextureDetail>> primaries = {});
    float nearest_outside(const Level& level, float x, float y) const;
    float bilinear(const Level& level, double u, double v) const;
    static std::size_t runs_of(float lo, float hi, std::uint32_t size, vdtree::Wrap wrap, Run (&runs)[2]);

    std::uint32_t width_ = 0, height_ = 0;
    vdtree::Wrap wrap_u_ = {}, wrap_v_ = {};
    std::vector<Level> levels_;
};

// Inline, for millions of samples.
inline float TextureDetail::nearest(std::size_t number, glm::vec2 uv) const {
    const Level& level = levels_[number];
    const float width = static_cast<float>(level.width), height = static_cast<float>(level.height);
    const float x = uv.x * width, y = uv.y * height;
    if (!(x >= 0 && y >= 0 && x < width && y < height)) return nearest_outside(level, x, y); // repeated, or no number
    return level.means[static_cast<std::size_t>(y) * level.width + static_cast<std::size_t>(x)];
}

struct TexturedLight {
    const TextureDetail* texture = nullptr; // none: luminances are the vertices' alone
    float dark = 0;                         // the luminance of what is black

    // Floats, or registers of them.
    template <class Floats>
    UNSEEN_INLINE Floats with_texture(Floats luminance, Floats its_texture) const {
        return dark + (luminance - dark) * its_texture;
    }

    // Over a triangle, of its corners' luminances and texture coordinates. There must be a texture.
    float mean(const std::array<float, 3>& luminance, const std::array<glm::vec2, 3>& uv) const;
};

// Texels a mesh unit, along the surface's direction with the fewest and with the most: the squares' means by area.
struct TextureDensity {
    float least = 0, most = 0;
    float mean = 0; // of the texture's luminance there, by area
};

class TextureDensities {
public:
    // Cost: one pass over the triangles.
    TextureDensities(const vdtree::SoundTree& tree, const TextureDetail& texture);

    // The density over the mesh's triangles that vanish under a node, and over these others around it.
    TextureDensity of(vdtree::NodeId node, std::span<const vdtree::Index> around) const;

private:
    struct Sum {
        double area = 0, least = 0, most = 0, light = 0; // the others times the area
        Sum& operator+=(const Sum& other) {
            area += other.area, least += other.least, most += other.most, light += other.light;
            return *this;
        }
    };
    Sum between(vdtree::Index first, vdtree::Index end) const; // triangles

    std::vector<Sum> before_triangle_;
    std::span<const vdtree::NodeId> subtree_end_;
    std::span<const vdtree::Index> first_triangle_;
};

} // namespace unseen::perception
