#include "measure/textured_light.h"

#include <algorithm>

#include <glm/common.hpp>

namespace unseen::perception {

// In the middles of nine equal parts, the texture's mean over a part in each.
float TexturedLight::mean(const std::array<float, 3>& luminance, const std::array<glm::vec2, 3>& uv) const {
    constexpr int parts = 3; // of a side
    const glm::vec2 low = glm::min(glm::min(uv[0], uv[1]), uv[2]), high = glm::max(glm::max(uv[0], uv[1]), uv[2]),
                    texels = (high - low) * texture->size();
    const std::size_t level = texture->level_of(std::max(texels.x, texels.y) / parts);
    float sum = 0;
    const auto add = [&](float second, float third) { // weights
        const float first = parts - second - third;
        const glm::vec2 at = (first * uv[0] + second * uv[1] + third * uv[2]) / static_cast<float>(parts);
        const float own = (first * luminance[0] + second * luminance[1] + third * luminance[2]) / parts;
        sum += with_texture(own, texture->at(level, at));
    };
    for (int i = 0; i < parts; ++i)
        for (int k = 0; i + k < parts; ++k) {
            add(static_cast<float>(i) + 1.0f / 3, static_cast<float>(k) + 1.0f / 3);
            if (i + k + 1 < parts) add(static_cast<float>(i) + 2.0f / 3, static_cast<float>(k) + 2.0f / 3);
        }
    return sum / (parts * parts);
}

} // namespace unseen::perception
