#include "screen_text.h"

#include <algorithm>
#include <cmath>

#include "drawing.h"

namespace unseen::app {
namespace {

// Mixed as light, the backing over white has a relative luminance of 0.125. On it, white has a contrast of
// 1.05 / 0.175, and the leads, of luminance 0.79, one of 0.84 / 0.175.
constexpr glm::vec4 backing(0.05f, 0.06f, 0.08f, 0.88f);
constexpr glm::vec3 letters(1.0f), leads(1.0f, 0.9f, 0.5f);
constexpr glm::vec3 mark(1.0f), rim(0.0f);

// In line heights.
constexpr double letter_height = 0.84, padding = 0.55, corner_radius = 0.45, lead_gap = 0.9;
constexpr double width_step = 2; // panels keep their width while numbers in them change
constexpr double least_line_px = 6;

// In line heights, too: text scales with them.
struct Layout {
    double lead = 0; // the column of leads, with its gap
    glm::dvec2 size = glm::dvec2(0);
};

Layout layout_of(std::span<const TextLine> lines) {
    constexpr double unit_px = 100;
    const auto width_of = [](const std::string& text) {
        return text.empty() ? 0 : Drawing::text_width(text, letter_height * unit_px) / unit_px;
    };
    double lead = 0, alone = 0, beside = 0;
    for (const TextLine& line : lines) {
        double& widest = line.lead.empty() ? alone : beside;
        widest = std::max(widest, width_of(line.text));
        lead = std::max(lead, width_of(line.lead));
    }
    Layout layout{lead > 0 ? lead + lead_gap : 0, {}};
    const double width = std::max(alone, layout.lead + beside);
    layout.size = {std::ceil(width / width_step) * width_step + 2 * padding,
                   static_cast<double>(lines.size()) + 2 * padding};
    return layout;
}

Result<Layer> layer_of(const Drawing& drawing, glm::ivec2 corner) {
    auto pixels = drawing.layer_pixels();
    if (!pixels) return pixels.error();
    return Layer{drawing.width(), drawing.height(), std::move(*pixels), corner};
}

} // namespace

Result<Layer> text_panel(std::span<const TextLine> lines, double line_px, glm::dvec2 most_px) {
    if (lines.empty()) return Layer{};
    const Layout layout = layout_of(lines);
    const double scale = std::min({line_px, most_px.x / layout.size.x, most_px.y / layout.size.y});
    if (!(scale >= least_line_px)) return Layer{};
    const glm::ivec2 size(glm::ceil(layout.size * scale));
    auto drawing = Drawing::layer(size.x, size.y);
    if (!drawing) return drawing.error();
    drawing->round_fill({0, 0}, size, corner_radius * scale, backing);
    const double height = letter_height * scale;
    glm::dvec2 at(padding * scale, padding * scale + (scale - height) / 2);
    for (const TextLine& line : lines) {
        drawing->text(at, line.lead, leads, height);
        drawing->text({at.x + (line.lead.empty() ? 0 : layout.lead * scale), at.y}, line.text, letters, height);
        at.y += scale;
    }
    return layer_of(*drawing, {0, 0});
}

std::vector<std::string> wrapped(std::string_view text, double line_px, double most_px) {
    std::vector<std::string> lines;
    while (!text.empty()) {
        const std::size_t end = std::min(text.find(' '), text.size());
        const std::string word(text.substr(0, end));
        text.remove_prefix(std::min(end + 1, text.size()));
        if (word.empty()) continue;
        const std::string longer = lines.empty() ? word : lines.back() + " " + word;
        if (!lines.empty() && Drawing::text_width(longer, letter_height * line_px) <= most_px) lines.back() = longer;
        else lines.push_back(word);
    }
    return lines;
}

Result<Layer> outline(std::span<const glm::dvec2> points, double width_px, bool dashed, glm::ivec2 window_px) {
    if (points.empty()) return Layer{};
    glm::dvec2 low = points[0], high = points[0];
    for (const glm::dvec2 point : points) {
        low = glm::min(low, point);
        high = glm::max(high, point);
    }
    const double reach = 1.5 * width_px + 1; // half of the rim, and a pixel of antialiasing
    const glm::dvec2 window(window_px);
    low = glm::clamp(glm::floor(low - reach), glm::dvec2(0), window);
    high = glm::clamp(glm::ceil(high + reach), glm::dvec2(0), window);
    const glm::ivec2 size(high - low);
    if (size.x <= 0 || size.y <= 0) return Layer{};
    auto drawing = Drawing::layer(size.x, size.y);
    if (!drawing) return drawing.error();
    std::vector<glm::dvec2> closed;
    for (const glm::dvec2 point : points) closed.push_back(point - low);
    closed.push_back(closed.front());
    drawing->line(closed, rim, 3 * width_px, dashed);
    drawing->line(closed, mark, width_px, dashed);
    return layer_of(*drawing, glm::ivec2(low));
}

} // namespace unseen::app
