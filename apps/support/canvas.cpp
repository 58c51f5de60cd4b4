#include "canvas.h"

#include <algorithm>
#include <cmath>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "bitmap_font.h"

namespace unseen::app {

Canvas::Canvas(int width, int height, glm::vec3 background) : image_{width, height, 3, {}} {
    image_.values.resize(image_.index(0, height, 0));
    fill(0, 0, width, height, background);
}

void Canvas::blend(int x, int y, glm::vec3 colour, float coverage) {
    if (x < 0 || y < 0 || x >= width() || y >= height()) return;
    for (int c = 0; c < 3; ++c) {
        float& value = image_.at(x, y, c);
        value += (colour[c] - value) * coverage;
    }
}

void Canvas::fill(int left, int top, int width, int height, glm::vec3 colour) {
    for (int y = std::max(top, 0); y < std::min(top + height, this->height()); ++y)
        for (int x = std::max(left, 0); x < std::min(left + width, this->width()); ++x) blend(x, y, colour);
}

void Canvas::line(glm::dvec2 from, glm::dvec2 to, glm::vec3 colour, double width) {
    const double reach = width / 2 + 1;
    const glm::dvec2 low = glm::min(from, to) - reach, high = glm::max(from, to) + reach;
    if (!(high.x >= 0 && high.y >= 0 && low.x <= this->width() && low.y <= this->height())) return;
    const glm::dvec2 along = to - from;
    const double length2 = glm::dot(along, along);
    const int left = static_cast<int>(std::max(low.x, 0.0)), top = static_cast<int>(std::max(low.y, 0.0));
    const int right = static_cast<int>(std::min<double>(high.x, this->width() - 1));
    const int bottom = static_cast<int>(std::min<double>(high.y, this->height() - 1));
    for (int y = top; y <= bottom; ++y) {
        for (int x = left; x <= right; ++x) {
            const glm::dvec2 pixel(x + 0.5, y + 0.5);
            const double t = length2 > 0 ? std::clamp(glm::dot(pixel - from, along) / length2, 0.0, 1.0) : 0;
            const double coverage = width / 2 + 0.5 - glm::length(pixel - (from + t * along));
            if (coverage > 0) blend(x, y, colour, static_cast<float>(std::min(coverage, 1.0)));
        }
    }
}

void Canvas::text(int left, int top, std::string_view text, glm::vec3 colour, int scale) {
    for (const char character : text) {
        const std::string_view ink = glyph(character);
        for (int row = 0; row < glyph_height; ++row)
            for (int column = 0; column < glyph_width; ++column)
                if (ink[static_cast<std::size_t>(row * glyph_width + column)] == '#')
                    fill(left + column * scale, top + row * scale, scale, scale, colour);
        left += glyph_advance * scale;
    }
}

void Canvas::text_upward(int left, int bottom, std::string_view text, glm::vec3 colour, int scale) {
    for (const char character : text) {
        const std::string_view ink = glyph(character);
        for (int row = 0; row < glyph_height; ++row)
            for (int column = 0; column < glyph_width; ++column)
                if (ink[static_cast<std::size_t>(row * glyph_width + column)] == '#')
                    fill(left + row * scale, bottom - (column + 1) * scale, scale, scale, colour);
        bottom -= glyph_advance * scale;
    }
}

void Canvas::picture(int left, int top, const perception::Image& picture) {
    for (int y = 0; y < picture.height; ++y) {
        for (int x = 0; x < picture.width; ++x) {
            const bool grey = picture.channels == 1;
            const glm::vec3 colour(picture.at(x, y, 0), picture.at(x, y, grey ? 0 : 1), picture.at(x, y, grey ? 0 : 2));
            blend(left + x, top + y, glm::clamp(colour, 0.0f, 1.0f));
        }
    }
}

int Canvas::text_width(std::string_view text, int scale) {
    return static_cast<int>(text.size()) * glyph_advance * scale;
}

int Canvas::text_height(int scale) { return glyph_height * scale; }

} // namespace unseen::app
