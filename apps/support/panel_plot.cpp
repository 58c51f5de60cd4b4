#include "panel_plot.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "canvas.h"

namespace unseen::app {
namespace {

constexpr glm::vec3 paper{1.0f}, ink{0.1f}, grid{0.85f};
constexpr int margin_left = 110, margin_right = 30, margin_top = 46, margin_bottom = 60; // pixels
constexpr int gap = 34;                                                                 // between panels, for their labels
constexpr int text_scale = 2;
constexpr double curve_width = 1.5, dash_px = 8; // pixels

// 1, 2 or 5 times a power of ten, so that about `count` of them fill the range.
double tick_step(double range, int count) {
    const double least = range / count;
    const double decade = std::pow(10.0, std::floor(std::log10(least)));
    for (const double step : {1.0, 2.0, 5.0})
        if (step * decade >= least) return step * decade;
    return 10 * decade;
}

std::string number(double value) { // 1500000 -> 1.5M
    const char* suffix = "";
    for (const auto& [scale, name] : {std::pair{1e9, "G"}, std::pair{1e6, "M"}, std::pair{1e3, "k"}}) {
        if (value < scale) continue;
        value /= scale;
        suffix = name;
        break;
    }
    std::array<char, 32> text;
    const auto end = std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general, 4).ptr;
    return std::string(text.data(), end) + suffix;
}

struct Box {
    double left, top, right, bottom, x_end, y_end;
    glm::dvec2 place(double x, double y) const {
        return {left + x / x_end * (right - left), bottom - y / y_end * (bottom - top)};
    }
};

void draw_grid(Canvas& canvas, const Box& box) {
    const double y_step = tick_step(box.y_end, 4);
    for (int i = 0; i * y_step <= box.y_end * (1 + 1e-9); ++i) {
        const glm::dvec2 at = box.place(0, i * y_step);
        canvas.line(at, {box.right, at.y}, grid);
        const std::string text = number(i * y_step);
        canvas.text(static_cast<int>(box.left) - 8 - Canvas::text_width(text, text_scale),
                    static_cast<int>(at.y) - Canvas::text_height(text_scale) / 2, text, ink, text_scale);
    }
    const double x_step = tick_step(box.x_end, 10);
    for (int i = 0; i * x_step <= box.x_end * (1 + 1e-9); ++i) {
        const glm::dvec2 at = box.place(i * x_step, 0);
        canvas.line({at.x, box.top}, at, grid);
    }
    canvas.line({box.left, box.bottom}, {box.right, box.bottom}, ink);
    canvas.line({box.left, box.top}, {box.left, box.bottom}, ink);
}

void draw_curve(Canvas& canvas, const Box& box, const Panel& panel) {
    for (std::size_t i = 0; i < panel.values.size(); ++i) {
        if (!std::isfinite(panel.values[i])) continue;
        const std::size_t next = std::min(i + 1, panel.values.size() - 1);
        const double end = std::isfinite(panel.values[next]) ? panel.values[next] : panel.values[i];
        canvas.line(box.place(static_cast<double>(i), panel.values[i]), box.place(static_cast<double>(next), end),
                    panel.colour, curve_width);
    }
}

void draw_panel(Canvas& canvas, const Box& box, const Panel& panel, std::vector<double> finite) {
    draw_grid(canvas, box);
    draw_curve(canvas, box, panel);
    std::string label = panel.label;
    if (!finite.empty()) {
        const auto middle = finite.begin() + static_cast<std::ptrdiff_t>(finite.size() / 2);
        std::nth_element(finite.begin(), middle, finite.end());
        const double y = box.place(0, *middle).y;
        for (double x = box.left; x < box.right; x += 2 * dash_px)
            canvas.line({x, y}, {std::min(x + dash_px, box.right), y}, panel.colour);
        label += "   median " + number(*middle) + ", largest " + number(*std::max_element(finite.begin(), finite.end()));
    }
    canvas.text(static_cast<int>(box.left), static_cast<int>(box.top) - Canvas::text_height(text_scale) - 6, label,
                panel.colour, text_scale);
}

} // namespace

perception::Image draw(const PanelPlot& plot) {
    const int count = static_cast<int>(plot.panels.size());
    const int height = margin_top + count * (plot.panel_height + gap) + margin_bottom;
    Canvas canvas(plot.width, height, paper);
    canvas.text((plot.width - Canvas::text_width(plot.title, text_scale)) / 2, 14, plot.title, ink, text_scale);
    Box box{margin_left, margin_top, static_cast<double>(plot.width - margin_right), margin_top, 1, 1};
    for (const Panel& panel : plot.panels) {
        std::vector<double> finite;
        for (const double value : panel.values)
            if (std::isfinite(value)) finite.push_back(value);
        constexpr double head_room = 1.05;
        box.x_end = std::max(1.0, static_cast<double>(panel.values.size()) - 1);
        box.y_end = finite.empty() ? 1 : *std::max_element(finite.begin(), finite.end()) * head_room;
        if (!(box.y_end > 0)) box.y_end = 1;
        box.top = box.bottom + gap;
        box.bottom = box.top + plot.panel_height;
        draw_panel(canvas, box, panel, std::move(finite));
    }
    const double x_step = tick_step(box.x_end, 10);
    for (int i = 0; i * x_step <= box.x_end * (1 + 1e-9); ++i) {
        const std::string text = number(i * x_step);
        canvas.text(static_cast<int>(box.place(i * x_step, 0).x) - Canvas::text_width(text, text_scale) / 2,
                    static_cast<int>(box.bottom) + 8, text, ink, text_scale);
    }
    canvas.text((plot.width - Canvas::text_width(plot.x_label, text_scale)) / 2, height - 26, plot.x_label, ink,
                text_scale);
    return canvas.image();
}

} // namespace unseen::app
