// Curves one below the other over a common axis, as a picture.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "drawing.h"

namespace unseen::app {

struct Panel {
    std::string label;               // with its unit
    glm::vec3 colour = glm::vec3(0); // code values
    std::vector<double> values;      // 0 and more, at 0, 1, 2, ...; what is not finite leaves a gap
};

struct PanelPlot {
    std::string title, x_label;
    std::vector<Panel> panels;
    std::size_t settled_from =
        0; // values before this one may leave their panel at its top: they do not count for its scale
    int width = 1200, panel_height = 190; // pixels
};

// Linear axes; each panel's begins at 0 and ends above its largest settled value, with the median of those as a dashed
// line. The largest of the others is in the panel's label where it does not fit.
void draw(const PanelPlot& plot, Drawing& drawing);

int height_of(const PanelPlot& plot); // pixels

Result<void> write_plot(const std::filesystem::path& file, const PanelPlot& plot);

} // namespace unseen::app
