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
    // `uvs`: by vertex. Its mip levels are means in linear light.
    static Result<SurfaceTexture> create(const vdtree::TextureView& texture, std::span<const glm::vec2> uvs);

    void describe(unsigned vertex_array) const; // the coordinates, as surface.vert takes them
    // The image, as surface.frag takes it. `least_share`: see SurfacePass::draw(); of programs that cut out.
    void bind(const Program& program, float lod_bias, float least_share) const;

    bool has_cut_outs() const noexcept { return has_cut_outs_; } // texels where nothing is drawn

private:
    SurfaceTexture() = default;

    Buffer uvs_;
    Texture2d image_;
    vdtree::UvBox box_;
    bool has_cut_outs_ = false;
};

} // namespace unseen::render
