// What the plots have in common.
#pragma once

#include <cmath>

#include <glm/vec3.hpp>

namespace unseen::app {

inline constexpr glm::vec3 plot_paper{1.0f}, plot_ink{0.1f};
inline constexpr double plot_text_height = 17; // pixels

// A line of one pixel is sharp where it runs through the middle of pixels.
inline double crisp(double place) { return std::floor(place) + 0.5; }

} // namespace unseen::app
