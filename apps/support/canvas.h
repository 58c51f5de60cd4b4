// Draws labels, lines and pictures into an RGB image of code values.
#pragma once

#include <string_view>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <perception/image.h>

namespace unseen::app {

// Code values 0..1, so what a PNG holds. Everything is clipped to the image. Pixels from the top left.
class Canvas {
public:
    Canvas(int width, int height, glm::vec3 background);

    const perception::Image& image() const noexcept { return image_; }
    int width() const noexcept { return image_.width; }
    int height() const noexcept { return image_.height; }

    // Mixes a colour into a pixel; `coverage` 0..1.
    void blend(int x, int y, glm::vec3 colour, float coverage = 1);
    void fill(int left, int top, int width, int height, glm::vec3 colour);
    // Antialiased, with round ends; `width` in pixels.
    void line(glm::dvec2 from, glm::dvec2 to, glm::vec3 colour, double width = 1);
    // The top left corner of the first character at (left, top); `scale` whole pixels a font pixel.
    void text(int left, int top, std::string_view text, glm::vec3 colour, int scale = 1);
    // Turned by a quarter to the left: reads upward, begins at (left, bottom).
    void text_upward(int left, int bottom, std::string_view text, glm::vec3 colour, int scale = 1);
    // Copies an image of code values, grey or RGB.
    void picture(int left, int top, const perception::Image& picture);

    static int text_width(std::string_view text, int scale = 1);
    static int text_height(int scale = 1);

private:
    perception::Image image_;
};

} // namespace unseen::app
