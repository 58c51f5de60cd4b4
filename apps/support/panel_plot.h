// Curves one below the other over a common axis, as a picture.
#pragma once

#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include <perception/image.h>

namespace unseen::app {

struct Panel {
    std::string label;              // with its unit
    glm::vec3 colour = glm::vec3(0); // code values
    std::vector<double> values;     // 0 and more, at 0, 1, 2, ...; what is not finite leaves a gap
};

struct PanelPlot {
    std::string title, x_label;
    std::vector<Panel> panels;
    int width = 1200, panel_height = 190; // pixels
};

// Linear axes; each panel's begins at 0 and ends above its largest value, with the median as a dashed line.
perception::Image draw(const PanelPlot& plot);

} // namespace unseen::app
