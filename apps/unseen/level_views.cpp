#include "level_views.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <unseen/render/internal/layers.h>
#include <unseen/session_gpu/scene_renderer.h>

#include "colour_bar.h"
#include "terminal.h"

namespace unseen::app {
namespace {

using perception::Image;
using session::LevelControl;

constexpr int gap = 4; // pixels between panels

Image beside_each_other(const std::vector<Image>& panels) {
    Image all{-gap, 0, 3, {}};
    for (const Image& panel : panels) {
        all.width += panel.width + gap;
        all.height = std::max(all.height, panel.height);
    }
    all.values.assign(3 * static_cast<std::size_t>(all.width) * static_cast<std::size_t>(all.height), 0.5F);
    int left = 0;
    for (const Image& panel : panels) {
        const auto row = 3 * static_cast<std::size_t>(panel.width);
        for (int y = 0; y < panel.height; ++y)
            std::copy_n(panel.values.begin() + static_cast<std::ptrdiff_t>(row * static_cast<std::size_t>(y)), row,
                        all.values.begin() +
                            3 * (static_cast<std::ptrdiff_t>(y) * all.width + static_cast<std::ptrdiff_t>(left)));
        left += panel.width + gap;
    }
    return all;
}

// From black by blue and green to yellow.
glm::vec3 colour_of_threshold(double share) {
    constexpr std::array<glm::vec3, 4> colours = {glm::vec3(0.05F, 0.02F, 0.2F), glm::vec3(0.15F, 0.35F, 0.65F),
                                                  glm::vec3(0.2F, 0.7F, 0.45F), glm::vec3(1.0F, 0.95F, 0.2F)};
    return mixed_colour(colours, share);
}

constexpr double least_threshold = 1.0 / 16, largest_threshold = 16; // cd/m2: the ends of the colours

Result<Image> picture_of_thresholds(LevelControl& control, int layer) {
    const auto thresholds = control.thresholds(layer);
    if (!thresholds) return thresholds.error();
    const double octaves = std::log2(largest_threshold / least_threshold);
    Image map{control.map_width(), control.map_height(), 3, {}};
    for (const float threshold : *thresholds) {
        const glm::vec3 c = colour_of_threshold(std::log2(static_cast<double>(threshold) / least_threshold) / octaves);
        map.values.insert(map.values.end(), {c.r, c.g, c.b});
    }
    ColourBar bar;
    bar.colour_at = colour_of_threshold;
    for (double at = least_threshold; at <= largest_threshold; at *= 4)
        bar.ticks.push_back({std::log2(at / least_threshold) / octaves, shortest(at)});
    bar.unit = "cd/m2 unseen";
    return with_colour_bar(map, bar);
}

// The best level is green, the worst one red.
glm::vec3 colour_of_level(double share) {
    constexpr glm::vec3 best(0.15F, 0.8F, 0.25F), middle(1.0F, 0.85F, 0.2F), worst(0.9F, 0.1F, 0.1F);
    const auto at = static_cast<float>(std::clamp(share, 0.0, 1.0));
    return at < 0.5F ? glm::mix(best, middle, 2 * at) : glm::mix(middle, worst, 2 * at - 1);
}

Result<Image> picture_of_levels(LevelControl& control, const Image& picture, int levels) {
    const auto by_pixel = control.read_levels();
    if (!by_pixel) return by_pixel.error();
    Image map = picture;
    const double last = std::max(levels - 1, 1);
    for (std::size_t i = 0; i < by_pixel->size(); ++i) {
        const float grey = (map.values[3 * i] + map.values[3 * i + 1] + map.values[3 * i + 2]) / 3;
        const int level = (*by_pixel)[i];
        const glm::vec3 c = level < 0 ? glm::vec3(grey) : colour_of_level(level / last) * (0.3F + 0.7F * grey);
        for (std::size_t channel = 0; channel < 3; ++channel)
            map.values[3 * i + channel] = c[static_cast<int>(channel)];
    }
    ColourBar bar;
    bar.colour_at = colour_of_level;
    for (int level = 0; level < levels; ++level) bar.ticks.push_back({level / last, std::to_string(level)});
    bar.unit = "level; 0 is the full mesh";
    return with_colour_bar(map, bar);
}

} // namespace

Result<render::Frame> frame_of(const render::Target& target) {
    const auto pixels = render::read_pixels(target);
    if (!pixels) return pixels.error();
    render::Frame frame;
    frame.width = target.width();
    frame.height = target.height();
    for (const glm::vec4& pixel : *pixels) {
        frame.luminance.push_back(pixel.a);
        frame.colour.insert(frame.colour.end(), {pixel.r, pixel.g, pixel.b});
    }
    return frame;
}

Result<Image> picture_of(LevelControl& control, const perception::Display& display,
                         const std::optional<LevelView>& show, int levels) {
    const auto coded = [&](const render::Target& target) -> Result<Image> {
        const auto frame = frame_of(target);
        if (!frame) return frame.error();
        return session::code_image(*frame, display);
    };
    if (!show) return coded(control.picture());
    if (*show == LevelView::levels) {
        const auto picture = coded(control.picture());
        if (!picture) return picture;
        return picture_of_levels(control, *picture, levels);
    }
    std::vector<Image> panels;
    for (int i = 0; i < control.layers().combination_count(); ++i) {
        auto panel = picture_of_thresholds(control, i);
        if (!panel) return panel.error();
        panels.push_back(std::move(*panel));
    }
    if (panels.empty()) return coded(control.picture()); // no object is in sight
    return beside_each_other(panels);
}

} // namespace unseen::app
