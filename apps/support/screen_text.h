// What windows lay over a picture: panels of text, and marks. Readable over anything.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <glm/gtc/type_precision.hpp>
#include <glm/vec2.hpp>

#include <unseen/vdtree/result.h>

namespace unseen::app {

// An image for render::Overlay: sRGB codes, and coverage in a. Row-major from the top left.
struct Layer {
    int width = 0, height = 0; // both 0: there is nothing to see
    std::vector<glm::u8vec4> pixels = {};
    glm::ivec2 corner = glm::ivec2(0); // its top left pixel in the window, of marks
};

// A line of a panel, in UTF-8. Lines with a lead, such as a key's name, stand behind a column of leads.
struct TextLine {
    std::string text;
    std::string lead = {};
    bool operator==(const TextLine&) const = default;
};

// Lines on a dark, translucent panel, `line_px` from one to the next. Letters have a contrast of 4.5 and more over any
// picture (WCAG 2.1, 1.4.3). The panel shrinks into `most_px`; there is none where its letters would become specks.
Result<Layer> text_panel(std::span<const TextLine> lines, double line_px, glm::dvec2 most_px);

// The text in lines of at most `most_px`, broken at spaces. A word that is longer stands alone, and sticks out.
std::vector<std::string> wrapped(std::string_view text, double line_px, double most_px);

// A closed line through the points of a window, light with a dark rim; what lies outside of the window is cut off.
Result<Layer> outline(std::span<const glm::dvec2> points, double width_px, bool dashed, glm::ivec2 window_px);

} // namespace unseen::app
