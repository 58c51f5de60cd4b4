// The measurement of folds in parts.
#pragma once

#include "fold/fold_errors.h"
#include "measure/measuring_progress.h"
#include "measure/texture_detail.h"

namespace unseen::perception {

struct MeasuredFolds { // by interior node
    std::vector<FoldRecord> folds;
    std::vector<FoldFacing> facing;
    std::vector<FoldTexture> textures; // of textured trees; else empty
};

// What a tree's wedges are given as luminance.
using Shading = Callback<float(vdtree::WedgeId)>;

struct MeasuredShadings {
    std::vector<MeasuredFolds> of; // by shading
    std::vector<std::uint8_t> stage_of;
    LitStages stages; // none where measure_folds() finds none
};

// As measure_folds(), but for shifts of the mean, for several luminances at once: first along each axis what light from
// there makes of the vertices, then their albedo where they differ. Which neighbours are folded with a node is the same
// for all, so they share what is measured of lengths, and where surfaces touch. Precondition: three or four of them; of
// a textured tree four. `dark`: by shading, what it is where a texture is black. `to_light`: from the shadings'
// luminances to those under a light.
Result<MeasuredShadings> measure_shadings(const vdtree::VertexTree& tree, std::span<const Shading> shadings,
                                          std::span<const float> dark, float to_light, int threads,
                                          const Progress& progress);

// Adds how much light many folds shift (FoldRecord::bias, FoldFacing::fading), under the tree's light. That depends on
// the order in which they are folded: that of what the model makes of each alone, whatever the factors of a criterion
// will be. `texture`: of texture_detail_of(). Cost: some 1.5 us a node.
Result<void> add_luminance_bias(const vdtree::VertexTree& tree, const TextureDetail* texture, MeasuredFolds& measured);

// Whether something lies over the surface: the texture, or other images by its coordinates, which are not known.
bool has_detail(const vdtree::VertexTree& tree);

// The detail of the tree's texture; what stands in for images where there are only coordinates, or the texture is of
// one colour; null where there is nothing. Over vertices of several hues as over white ones.
std::shared_ptr<const TextureDetail> texture_detail_of(const vdtree::VertexTree& tree);

// Nothing where there is no tree.
template <class T>
void add_attribute(Result<vdtree::VertexTree>& tree, std::string_view name, vdtree::AttributeDomain domain,
                   std::vector<T> values) {
    if (tree) tree = tree->with_attribute(name, domain, std::move(values));
}

// The tree with these as measure_folds() keeps them.
Result<vdtree::VertexTree> with_records(const vdtree::VertexTree& tree, MeasuredFolds measured,
                                        std::vector<std::uint8_t> stage_of, std::vector<FoldStage> stages);

// Reads the errors, and notes in which stage every node folds. No stages for trees with translucent vertices, and of no
// extent. `rgb`: how wedges are drawn; none: in luminance alone. `lights`, `textures`: with the tree's texture, where it
// has one, of the luminance or of each primary, and what folds make of that. Cost: some hundred pictures of up to half
// of the triangles; in parallel. Goes on to all of what is to be done; where that says to stop, the answer is of no use.
std::vector<FoldStage> find_stages(const vdtree::SoundTree& tree, std::span<const glm::vec3> rgb,
                                   std::span<const TexturedLight> lights, std::span<const FoldTexture> textures,
                                   std::span<FoldError> errors, MeasuringProgress& progress);

// The same under any lights. `errors`: of folds under light from everywhere. `texture`: dark where the texture is.
// Cost: three to four times as many pictures.
LitStages find_lit_stages(const vdtree::SoundTree& tree, const TexturedLight& texture,
                          std::span<const FoldTexture> textures, std::span<FoldError> errors,
                          MeasuringProgress& progress);

// Reads the luminance errors and extents, and adds the bias. Cost: as of folding the mesh once, one node after the
// other. `light`, `textures`: with the tree's texture, where it has one, and what folds make of that.
void find_luminance_bias(const vdtree::SoundTree& tree, const TexturedLight& light,
                         std::span<const FoldTexture> textures, std::span<FoldError> errors);

// The radius of what a fold of the node changes, in mesh units. What a fold changes of slivers is as long as they are,
// and about as wide as the support: no more than the latter's multiple counts, or else all folds of a fan were alike,
// the first and the last.
inline float changed_radius(const vdtree::VertexTree& tree, std::span<const FoldError> errors, vdtree::NodeId node) {
    constexpr float most_extent = 4; // radii of the support: twice that of regular meshes' finest nodes
    const float radius = tree.support_spheres()[node].radius;
    return std::max(radius, std::min(errors[node].extent, most_extent * radius));
}

} // namespace unseen::perception
