// What a fold changes of a texture: by how far it slides over the surface, and the contrasts of its detail.
#pragma once

#include <unseen/vdtree/internal/texture_bounds.h>
#include <unseen/vdtree/internal/tree_parts.h>
#include <unseen/vdtree/internal/vertex_tree_data.h>

#include "measure/fold_record.h"
#include "measure/ring_layout.h"
#include "measure/texture_detail.h"

namespace unseen::perception {

// How two surfaces differ at a point, in each of the luminances that are measured at once.
template <std::size_t count>
struct FoldDifference {
    float distance = 0;
    float slide = 0; // texels, of a texture
    std::array<float, count> luminance = {};

    void include(const FoldDifference& other) {
        distance = std::max(distance, other.distance), slide = std::max(slide, other.slide);
        for (std::size_t i = 0; i < count; ++i) luminance[i] = std::max(luminance[i], other.luminance[i]);
    }
    float largest_luminance() const { return *std::max_element(luminance.begin(), luminance.end()); }
};

// Points have this many luminances, and then the texture coordinates.
template <std::size_t luminances>
class TextureChange {
public:
    static constexpr std::size_t channels = luminances + 2, u_channel = luminances, v_channel = luminances + 1;
    using FoldPicture = FoldPictureOf<channels>;
    using Point = LitPointOf<channels>;

    // `lights`: by luminance. `has_colours`: the luminances are the primaries, each with its own texture, and what is
    // compared is as_luminances() of these. Refers to all but the last.
    TextureChange(const vdtree::SoundTree& tree, std::span<const TexturedLight> lights, const TextureDetail& texture,
                  bool has_colours)
        : tree_(tree), lights_(lights), texture_(texture), has_colours_(has_colours), densities_(tree, texture_) {
        vdtree::TreeParts parts(links_of(*tree.data().geometry));
        parts.assign_triangles(tree.first_triangle(), tree.triangles());
        footprints_ = bound_footprints(*tree.data().geometry, parts);
    }

    // The texture around a node.
    struct Here {
        TextureDensity density;
        std::array<std::size_t, measurement::picture_sizes.size()> level = {}; // that pictures show
        std::array<typename FoldPicture::BandCells, measurement::picture_sizes.size()> weights;
        float middle = 1; // of the texture's luminance in the ring
        float slide = 0;  // texels, as pictures show it, in the mean over some cells
    };
    // Fills `here` for a node whose fold changes this width.
    void look_at(vdtree::NodeId node, std::span<const vdtree::Index> crossing, float width, Here& here) const {
        here.density = densities_.of(node, crossing);
        for (std::size_t size = 0; size < measurement::picture_sizes.size(); ++size) {
            const float cell =
                2 * measurement::picture_sizes[size] * width / static_cast<float>(measurement::picture_side);
            here.level[size] = texture_.level_of(here.density.most * cell);
        }
        if (!tree_.ring_texture().empty()) {
            const vdtree::LuminanceRange range = tree_.ring_texture()[node];
            here.middle = (range.lo + range.hi) / 2;
        }
        here.slide = 0;
    }

    // Two points, as channels.
    void compare(const std::array<float, channels>& a, const std::array<float, channels>& b, const Here& here,
                 FoldDifference<luminances>& found) const {
        found.slide = slide_between(a[u_channel], a[v_channel], b[u_channel], b[v_channel]);
        const float t0 = texture_.at(here.level[0], {a[u_channel], a[v_channel]}),
                    t1 = texture_.at(here.level[0], {b[u_channel], b[v_channel]});
        const float weight = over_local_mean(here.middle, (t0 + t1) / 2);
        const auto was = shown(a.data(), {a[u_channel], a[v_channel]}, here.level[0], t0),
                   is = shown(b.data(), {b[u_channel], b[v_channel]}, here.level[0], t1);
        for (std::size_t k = 0; k < luminances; ++k) found.luminance[k] = weight * std::abs(was[k] - is[k]);
    }

    // Puts the texture on the mesh's pictures, once they are drawn.
    void begin_pictures(std::span<FoldPicture> pictures, Here& here) const {
        for (std::size_t size = 0; size < pictures.size(); ++size) {
            FoldPicture& picture = pictures[size];
            typename FoldPicture::Cells textures;
            shade(picture, FoldPicture::Layer::mesh, here.level[size], &textures);
            picture.find_means(FoldPicture::Layer::mesh, textures, here.weights[size]);
            for (typename FoldPicture::Cells& of_band : here.weights[size])
                for (float& weight : of_band) weight = weight >= 0 ? over_local_mean(here.middle, weight) : 1.0f;
        }
    }

    // The same for a picture of the folded surface.
    void finish_picture(FoldPicture& picture, std::size_t size, Here& here) const {
        const auto &mesh = picture.picture(FoldPicture::Layer::mesh),
                   &folded = picture.picture(FoldPicture::Layer::folded);
        typename FoldPicture::Cells slides;
        for (std::size_t cell = 0; cell < slides.size(); ++cell) {
            const bool are_seen = FoldPicture::is_seen(mesh.height[cell]) && FoldPicture::is_seen(folded.height[cell]);
            slides[cell] = are_seen
                               ? slide_between(mesh.luminance[u_channel][cell], mesh.luminance[v_channel][cell],
                                               folded.luminance[u_channel][cell], folded.luminance[v_channel][cell])
                               : 0.0f;
        }
        here.slide = std::max(here.slide, picture.largest_mean(slides));
        shade(picture, FoldPicture::Layer::folded, here.level[size], nullptr);
    }

    // What the texture's detail changes: what is finer than the pictures' cells by sliding over the surface, and all of
    // it by the surface's shift, seen from aside.
    void find_detail(vdtree::NodeId node, float width, const Here& here, const Ring<channels>& ring,
                     const FoldRecord& record, FoldTexture& found) const {
        thread_local std::vector<vdtree::UvBox> boxes; // by wedge
        const vdtree::WedgeId first = tree_.first_wedge(node);
        boxes.assign(footprints_.begin() + first, footprints_.begin() + tree_.wedge_end(node));
        for (const auto* surface : {&ring.before, &ring.after, &ring.fine_before, &ring.fine_after})
            for (const RingTriangle<channels>& t : *surface)
                for (const Point& p : t.corner)
                    boxes[t.sheet].include({p.luminance[u_channel], p.luminance[v_channel]});
        const auto contrast_of = [&](std::size_t level) {
            float largest = 0;
            for (const vdtree::UvBox& box : boxes) largest = std::max(largest, texture_.contrast(level, box));
            return largest;
        };
        const bool is_dense = here.density.least > 0 && std::isfinite(here.density.most);
        const float height = std::max(record.shift, record.mean_distance);
        const float aside = height > 0 ? height * here.density.most : 0.0f;
        found.mean = here.density.mean;
        const float slide_in_widths = is_dense ? here.slide / (here.density.least * width) : 1.0f;
        found.slide = std::max(found.slide, slide_in_widths < 1 ? slide_in_widths : 1.0f);
        const std::size_t measured_from = *std::min_element(here.level.begin(), here.level.end());
        for (std::size_t level = 0; level < texture_.level_count(); ++level) {
            const float texel = std::exp2(static_cast<float>(level)); // in the texture's own
            const float wave = is_dense ? texels_of_wave * texel / here.density.least : 0.0f;
            if (level >= measured_from && wave > 2 * width) break; // as the ring's range shows it
            const float slide = aside + (level < measured_from ? here.slide : 0.0f);
            if (!(slide > 0)) continue;
            const float contrast = 2 * std::min(1.0f, slide / texel) * contrast_of(level);
            const float octaves = wave > 0 ? std::floor(std::log2(width / wave)) : 0.0f;
            const auto finer =
                static_cast<std::size_t>(std::clamp(octaves, 0.0f, static_cast<float>(texture_octaves - 1)));
            found.contrast[finer] = std::max(found.contrast[finer], std::min(contrast, most_texture_contrast));
        }
    }

private:
    // By how much contrasts over a local mean of the texture are more than those over the middle of its range, by which
    // a criterion divides.
    static float over_local_mean(float middle, float local_mean) {
        return std::max(1.0f, (middle + FoldStage::black) / (local_mean + FoldStage::black));
    }

    // What the texture leaves of a point's luminances. `texture`: its luminance there.
    std::array<float, luminances> shown(const float* own, glm::vec2 uv, std::size_t level, float texture) const {
        std::array<float, luminances> all;
        for (std::size_t k = 0; k < luminances; ++k)
            all[k] = lights_[k].with_texture(own[k], has_colours_ ? lights_[k].texture->at(level, uv) : texture);
        if constexpr (luminances == 3)
            if (has_colours_) {
                const glm::vec3 seen = as_luminances(glm::vec3(all[0], all[1], all[2]));
                all = {seen.x, seen.y, seen.z};
            }
        return all;
    }

    float slide_between(float u0, float v0, float u1, float v1) const {
        const glm::vec2 size = texture_.size();
        const float slide = std::max(std::abs(u1 - u0) * size.x, std::abs(v1 - v0) * size.y);
        return std::min(slide, std::max(size.x, size.y));
    }

    // Makes the luminances of a picture those that the texture leaves of them.
    void shade(FoldPicture& picture, typename FoldPicture::Layer layer, std::size_t level,
               typename FoldPicture::Cells* textures) const {
        typename FoldPicture::Picture& of = picture.picture(layer);
        for (std::size_t cell = 0; cell < of.height.size(); ++cell) {
            if (textures) (*textures)[cell] = 0;
            if (!FoldPicture::is_seen(of.height[cell])) continue;
            const glm::vec2 uv(of.luminance[u_channel][cell], of.luminance[v_channel][cell]);
            const float texture = texture_.at(level, uv);
            std::array<float, luminances> own;
            for (std::size_t i = 0; i < luminances; ++i) own[i] = of.luminance[i][cell];
            const auto seen = shown(own.data(), uv, level, texture);
            for (std::size_t i = 0; i < luminances; ++i) of.luminance[i][cell] = seen[i];
            if (textures) (*textures)[cell] = texture;
        }
    }

    // The lowest frequency that a level's detail has much of.
    static constexpr float texels_of_wave = 4;

    const vdtree::SoundTree& tree_;
    std::span<const TexturedLight> lights_;
    const TextureDetail& texture_;
    bool has_colours_;
    TextureDensities densities_;
    std::vector<vdtree::UvBox> footprints_; // by wedge
};

} // namespace unseen::perception
