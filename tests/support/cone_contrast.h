// Contrast in castleCSF's three directions, from the cones' responses.
#pragma once

#include <cmath>

#include <glm/vec3.hpp>

#include <unseen/perception/csf.h>

namespace unseen::support {

struct OpponentContrast {
    double luminance = 0, red_green = 0, yellow_violet = 0;
};
// Of a change on a background, both as L, M, S (CIE 2006, 2 degrees, scaled so that L + M is the luminance): Wuerger,
// Ashraf, Kim, Martinovic, Perez-Ortiz, Mantiuk 2020.
inline OpponentContrast opponent_contrast(const glm::dvec3& background, const glm::dvec3& delta) {
    const double luminance = background.x + background.y;
    return {std::abs(delta.x + delta.y) / luminance, std::abs(delta.x - 2.3112 * delta.y) / luminance,
            std::abs(50.9875 * delta.z - delta.x - delta.y) / luminance};
}
// How far above threshold a coloured grating is; 1 is just visible.
inline double castle_visibility(const OpponentContrast& contrast, const perception::Stimulus& stimulus) {
    using perception::CsfModel;
    return std::hypot(contrast.luminance * sensitivity(CsfModel::castle, stimulus),
                      contrast.red_green * sensitivity(CsfModel::castle_red_green, stimulus),
                      contrast.yellow_violet * sensitivity(CsfModel::castle_yellow_violet, stimulus));
}

} // namespace unseen::support
