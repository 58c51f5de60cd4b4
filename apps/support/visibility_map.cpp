#include "visibility_map.h"

#include <cmath>

#include <glm/common.hpp>
#include <glm/vec3.hpp>

namespace unseen::app {
namespace {

constexpr float octaves_to_red = 3;

glm::vec3 colour_of(float visibility) {
    constexpr glm::vec3 none{0.02f, 0.02f, 0.08f}, almost{0.25f, 0.5f, 0.9f}, just{1.0f, 0.95f, 0.2f},
        far{0.85f, 0.0f, 0.0f};
    const bool is_visible = !(visibility < 1);
    const float share = is_visible ? std::log2(visibility) / octaves_to_red : visibility;
    const float bounded = share < 1 ? share : 1; // also for NaN
    return is_visible ? glm::mix(just, far, bounded) : glm::mix(none, almost, bounded);
}

// The first quarter of the bar is what cannot be seen, then come octaves.
constexpr double invisible_part = 0.25;

double visibility_at(double share) {
    return share < invisible_part
               ? share / invisible_part
               : std::exp2((share - invisible_part) / (1 - invisible_part) * static_cast<double>(octaves_to_red));
}
double place_of_octave(double octave) {
    return invisible_part + octave / static_cast<double>(octaves_to_red) * (1 - invisible_part);
}

} // namespace

perception::Image visibility_map(const perception::Image& visibility) {
    perception::Image map{visibility.width, visibility.height, 3, {}};
    map.values.reserve(3 * visibility.values.size());
    for (const float v : visibility.values) {
        const glm::vec3 colour = colour_of(v);
        map.values.insert(map.values.end(), {colour.r, colour.g, colour.b});
    }
    return map;
}

ColourBar visibility_bar() {
    ColourBar bar;
    bar.colour_at = [](double share) { return colour_of(static_cast<float>(visibility_at(share))); };
    bar.ticks = {{0, "0"},
                 {place_of_octave(0), "1"},
                 {place_of_octave(1), "2"},
                 {place_of_octave(2), "4"},
                 {place_of_octave(3), "8"}};
    bar.unit = "times the threshold; from 1 on visible";
    return bar;
}

} // namespace unseen::app
