#include "visibility_map.h"

#include <cmath>

#include <glm/common.hpp>
#include <glm/vec3.hpp>

namespace unseen::app {

perception::Image visibility_map(const perception::Image& visibility) {
    constexpr glm::vec3 none{0.02f, 0.02f, 0.08f}, almost{0.25f, 0.5f, 0.9f}, just{1.0f, 0.95f, 0.2f},
        far{0.85f, 0.0f, 0.0f};
    constexpr float octaves_to_red = 3;
    perception::Image map{visibility.width, visibility.height, 3, {}};
    map.values.reserve(3 * visibility.values.size());
    for (const float v : visibility.values) {
        const bool is_visible = !(v < 1);
        const float share = is_visible ? std::log2(v) / octaves_to_red : v;
        const float bounded = share < 1 ? share : 1; // also for NaN
        const glm::vec3 colour = is_visible ? glm::mix(just, far, bounded) : glm::mix(none, almost, bounded);
        map.values.insert(map.values.end(), {colour.r, colour.g, colour.b});
    }
    return map;
}

} // namespace unseen::app
