// A model's texture on the GPU, with the coordinates of its vertices.
#pragma once

#include <span>

#include <glm/vec2.hpp>
#include <glm/vec4.hpp>

#include <unseen/vdtree/internal/texture_pyramid.h>
#include <unseen/vdtree/mesh.h>

#include "program.h"

namespace unseen::render {

// Move-only; needs a current context for everything. GL errors other than too little memory are left for the caller to
// ask for.
class SurfaceTexture {
public:
    // `uvs`: by vertex. Mip levels are means in linear light, of normal maps of their vectors.
    static Result<SurfaceTexture> create(const vdtree::TextureView& texture, std::span<const glm::vec2> uvs);

    void describe(unsigned vertex_array) const; // the coordinates, as surface.vert takes them
    // In place of a share: of pixels with one sample.
    static constexpr float by_pixels = -1;
    // The maps, as surface.frag takes them. `least_share`: see SurfacePass::draw(); of programs that cut out.
    void bind(const Program& program, float lod_bias, float least_share) const;

    bool has_cut_outs() const noexcept { return has_cut_outs_; } // texels where nothing is drawn, or not all
    bool blends() const noexcept { return blends_; }             // of these, by shares also where texels are wide
    bool has_emission() const noexcept { return static_cast<bool>(emission_); }
    bool has_relief() const noexcept { return static_cast<bool>(relief_); }

private:
    SurfaceTexture() = default;

    Buffer uvs_;
    Texture2d image_;
    Texture2d emission_, relief_; // or none
    vdtree::UvBox box_;
    bool has_cut_outs_ = false, blends_ = false;
};

} // namespace unseen::render
