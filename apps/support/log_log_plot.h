// Curves on logarithmic axes, as a picture.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "drawing.h"

namespace unseen::app {

struct Curve {
    std::string label;               // empty: not in the legend
    glm::vec3 colour = glm::vec3(0); // code values
    bool dashed = false;
    std::vector<glm::dvec2> points; // ascending in x; those outside of the axes are left out
};

struct LogLogPlot {
    std::string title, x_label, y_label;
    glm::dvec2 x_range = {0.1, 100}; // positive, ascending
    glm::dvec2 y_range = {1, 1000};
    std::vector<Curve> curves;
    int width = 1200, height = 680; // pixels
};

// With a grid at 1, 2, 5 of every decade, labels, and a legend to the right.
void draw(const LogLogPlot& plot, Drawing& drawing);

// As .svg or .png, by the file's ending.
Result<void> write_plot(const std::filesystem::path& file, const LogLogPlot& plot);

} // namespace unseen::app
