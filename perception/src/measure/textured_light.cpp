#include "measure/textured_light.h"

#include <algorithm>

#include <glm/common.hpp>

namespace unseen::perception {

namespace {

// Of a triangle's side: equal parts of about so many texels each, in whose middles the texture's mean is looked up.
// With coarser ones, what the means are wrong by looks like light that folds add; more than so many cost more than they
// tell.
constexpr float texels_of_part = 1;
constexpr int fewest_parts = 3, most_parts = 32;

} // namespace

float TexturedLight::mean(const std::array<float, 3>& luminance, const std::array<glm::vec2, 3>& uv) const {
    const glm::vec2 low = glm::min(glm::min(uv[0], uv[1]), uv[2]), high = glm::max(glm::max(uv[0], uv[1]), uv[2]),
                    texels = (high - low) * texture->size();
    const float side = std::max(texels.x, texels.y);
    const int parts = static_cast<int>(
        std::clamp(std::ceil(side / texels_of_part), static_cast<float>(fewest_parts), static_cast<float>(most_parts)));
    const auto count = static_cast<float>(parts);
    const std::size_t level = texture->level_of(side / count);
    float sum = 0;
    const auto add = [&](float second, float third) { // weights
        const float first = count - second - third;
        const glm::vec2 at = (first * uv[0] + second * uv[1] + third * uv[2]) / count;
        const float own = (first * luminance[0] + second * luminance[1] + third * luminance[2]) / count;
        sum += with_texture(own, texture->at(level, at));
    };
    for (int i = 0; i < parts; ++i)
        for (int k = 0; i + k < parts; ++k) {
            add(static_cast<float>(i) + 1.0f / 3, static_cast<float>(k) + 1.0f / 3);
            if (i + k + 1 < parts) add(static_cast<float>(i) + 2.0f / 3, static_cast<float>(k) + 2.0f / 3);
        }
    return sum / (count * count);
}

} // namespace unseen::perception
