// What a texture makes of the luminances of a tree's vertices.
#pragma once

#include <array>

#include <glm/vec2.hpp>

#include <unseen/vdtree/internal/simd.h>

#include "measure/texture_detail.h"

namespace unseen::perception {

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

} // namespace unseen::perception
