#include "colour_bar.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <glm/common.hpp>

#include "drawing.h"

namespace unseen::app {
namespace {

constexpr glm::vec3 background{0.0f}, ink{0.95f}, weak{0.7f};
constexpr double margin = 8, bar_height = 10, text_height = 14, least_text_height = 10, line_gap = 4,
                 tick_gap = 6; // pixels
constexpr double legend_height = margin + bar_height + 2 * (line_gap + text_height) + margin;

void draw_bar(Drawing& drawing, const ColourBar& bar, double unit_height) {
    const double left = margin, length = drawing.width() - 2 * margin;
    for (double x = 0; x < length; ++x)
        drawing.fill({left + x, margin}, {1, bar_height}, bar.colour_at(length > 1 ? x / (length - 1) : 0));
    double free_from = -std::numeric_limits<double>::infinity(); // of text
    for (const ColourBar::Tick& tick : bar.ticks) {
        const double at = left + std::round(std::clamp(tick.share, 0.0, 1.0) * (length - 1)),
                     half = Drawing::text_width(tick.text, text_height) / 2;
        const double middle = std::clamp(at, half, std::max(half, drawing.width() - half));
        if (middle - half < free_from) continue;
        drawing.fill({at, margin}, {1, bar_height + 3}, ink);
        drawing.text({middle, margin + bar_height + line_gap}, tick.text, ink, text_height, Align::centre);
        free_from = middle + half + tick_gap;
    }
    drawing.text({left, margin + bar_height + 2 * line_gap + text_height}, bar.unit, weak, unit_height);
}

// ---- what a judge saw

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

Result<perception::Image> with_colour_bar(const perception::Image& map, const ColourBar& bar) {
    const double unit_height =
        std::max(least_text_height, Drawing::fitting_height(bar.unit, text_height, map.width - 2 * margin));
    const int width = std::max(
        map.width, static_cast<int>(std::ceil(2 * margin + Drawing::text_width(bar.unit, unit_height) - 0.01)));
    auto legend = Drawing::create(width, static_cast<int>(legend_height), background);
    if (!legend) return legend.error();
    draw_bar(*legend, bar, unit_height);
    const auto below = legend->image();
    if (!below) return below.error();
    // Put together by rows: a map may be larger than what can be drawn on.
    perception::Image whole{width, map.height + below->height, 3, {}};
    whole.values.assign(whole.index(0, whole.height, 0), 0);
    for (int y = 0; y < map.height; ++y)
        std::copy_n(map.values.begin() + static_cast<std::ptrdiff_t>(map.index(0, y, 0)), 3 * map.width,
                    whole.values.begin() + static_cast<std::ptrdiff_t>(whole.index(0, y, 0)));
    std::copy(below->values.begin(), below->values.end(),
              whole.values.begin() + static_cast<std::ptrdiff_t>(whole.index(0, map.height, 0)));
    return whole;
}

glm::vec3 mixed_colour(std::span<const glm::vec3> colours, double share) {
    const double at = std::clamp(share, 0.0, 1.0) * static_cast<double>(colours.size() - 1);
    const auto first = std::min(static_cast<std::size_t>(at), colours.size() - 2);
    return glm::mix(colours[first], colours[first + 1], static_cast<float>(at - static_cast<double>(first)));
}

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
