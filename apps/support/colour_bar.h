// Maps of values as colours, with the scale that says which is which.
#pragma once

#include <span>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include <unseen/perception/image.h>

namespace unseen::app {

struct ColourBar {
    struct Tick {
        double share = 0; // of the bar, 0..1
        std::string text;
    };
    glm::vec3 (*colour_at)(double share) = nullptr; // 0..1
    std::vector<Tick> ticks;                        // ascending; those that would run into the one before are left out
    std::string unit;
};

// A map in code values with the bar and its unit below it: pixels keep their places. Wider than the map where that is
// too narrow for the text, the rest black.
Result<perception::Image> with_colour_bar(const perception::Image& map, const ColourBar& bar);

// `share` 0..1 of the way through evenly spaced colours, mixed between neighbours.
glm::vec3 mixed_colour(std::span<const glm::vec3> colours, double share);

// ---- what a judge saw

// Invisible differences in blues, visible ones from yellow (just so) to red (8 times that and more). Code values.
perception::Image visibility_map(const perception::Image& visibility);

// The bar of these colours: thresholds of visibility.
ColourBar visibility_bar();

} // namespace unseen::app
