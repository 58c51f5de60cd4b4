#include "colour_bar.h"

#include <algorithm>
#include <cmath>
#include <limits>

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

} // namespace unseen::app
