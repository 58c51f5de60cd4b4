#include "plot.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "canvas.h"

namespace unseen::app {
namespace {

constexpr glm::vec3 paper{1.0f}, ink{0.1f}, faint{0.88f}, grid{0.75f};
constexpr int margin_left = 92, margin_right = 24, margin_top = 46, margin_bottom = 60; // pixels
constexpr int text_scale = 2;
constexpr int legend_sample = 34, legend_padding = 12; // pixels
constexpr double curve_width = 2;                      // pixels
constexpr double dash_px = 8, gap_px = 6;

std::string number(double value) {
    std::array<char, 32> text;
    return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

int legend_width(const std::vector<Curve>& curves) {
    int widest = 0;
    for (const Curve& curve : curves) widest = std::max(widest, Canvas::text_width(curve.label, text_scale));
    return widest + legend_sample + 2 * legend_padding;
}

// Where values lie in the picture.
class Axes {
public:
    explicit Axes(const LogLogPlot& plot)
        : low_(std::log10(plot.x_range.x), std::log10(plot.y_range.x)),
          high_(std::log10(plot.x_range.y), std::log10(plot.y_range.y)), left_(margin_left), top_(margin_top),
          right_(plot.width - legend_width(plot.curves) - margin_right), bottom_(plot.height - margin_bottom) {}

    glm::dvec2 place(glm::dvec2 value) const {
        const glm::dvec2 share = (glm::dvec2(std::log10(value.x), std::log10(value.y)) - low_) / (high_ - low_);
        return {left_ + share.x * (right_ - left_), bottom_ - share.y * (bottom_ - top_)};
    }
    bool shows(glm::dvec2 value) const {
        const glm::dvec2 at = place(value);
        return at.x >= left_ && at.x <= right_ && at.y >= top_ && at.y <= bottom_;
    }
    int left() const { return left_; }
    int top() const { return top_; }
    int right() const { return right_; }
    int bottom() const { return bottom_; }

private:
    glm::dvec2 low_, high_;
    int left_, top_, right_, bottom_;
};

// 1, 2 and 5 of every decade within the range.
std::vector<double> ticks(glm::dvec2 range) {
    constexpr double slack = 1 + 1e-9; // decimal powers are not exact
    std::vector<double> values;
    for (int decade = static_cast<int>(std::floor(std::log10(range.x))); decade <= std::log10(range.y); ++decade) {
        for (const double step : {1.0, 2.0, 5.0}) {
            // Divided for negative powers, so that 0.1 is the number that prints as 0.1.
            const double value = decade < 0 ? step / std::pow(10.0, -decade) : step * std::pow(10.0, decade);
            if (value * slack >= range.x && value <= range.y * slack) values.push_back(value);
        }
    }
    return values;
}

bool is_decade(double value) {
    const double decades = std::log10(value);
    return std::abs(decades - std::round(decades)) < 1e-9;
}

void draw_grid(Canvas& canvas, const LogLogPlot& plot, const Axes& axes) {
    for (const double x : ticks(plot.x_range)) {
        const double at = axes.place({x, plot.y_range.x}).x;
        canvas.line({at, axes.top()}, {at, axes.bottom()}, is_decade(x) ? grid : faint);
        const std::string text = number(x);
        canvas.text(static_cast<int>(at) - Canvas::text_width(text, text_scale) / 2, axes.bottom() + 8, text, ink,
                    text_scale);
    }
    for (const double y : ticks(plot.y_range)) {
        const double at = axes.place({plot.x_range.x, y}).y;
        canvas.line({axes.left(), at}, {axes.right(), at}, is_decade(y) ? grid : faint);
        const std::string text = number(y);
        canvas.text(axes.left() - 6 - Canvas::text_width(text, text_scale), static_cast<int>(at) - 7, text, ink,
                    text_scale);
    }
    const glm::dvec2 a(axes.left(), axes.top()), b(axes.right(), axes.bottom());
    canvas.line(a, {b.x, a.y}, ink);
    canvas.line({b.x, a.y}, b, ink);
    canvas.line(b, {a.x, b.y}, ink);
    canvas.line({a.x, b.y}, a, ink);
}

void draw_dashed(Canvas& canvas, glm::dvec2 from, glm::dvec2 to, glm::vec3 colour, double& phase) {
    const double length = std::hypot(to.x - from.x, to.y - from.y);
    constexpr double step = 1; // pixel
    for (double done = 0; done < length; done += step) {
        if (std::fmod(phase + done, dash_px + gap_px) >= dash_px) continue;
        const double end = std::min(done + step, length);
        canvas.line(from + (to - from) * (done / length), from + (to - from) * (end / length), colour, curve_width);
    }
    phase += length;
}

void draw_curve(Canvas& canvas, const Curve& curve, const Axes& axes) {
    double phase = 0;
    for (std::size_t i = 1; i < curve.points.size(); ++i) {
        if (!axes.shows(curve.points[i - 1]) || !axes.shows(curve.points[i])) continue;
        const glm::dvec2 from = axes.place(curve.points[i - 1]), to = axes.place(curve.points[i]);
        if (curve.dashed) draw_dashed(canvas, from, to, curve.colour, phase);
        else canvas.line(from, to, curve.colour, curve_width);
    }
}

void draw_legend(Canvas& canvas, const std::vector<Curve>& curves, const Axes& axes) {
    constexpr int row = 20; // pixels
    const int left = axes.right() + legend_padding;
    for (std::size_t i = 0; i < curves.size(); ++i) {
        const int y = axes.top() + static_cast<int>(i) * row;
        const glm::dvec2 from(left, y + 7), to(left + legend_sample, y + 7);
        double phase = 0;
        if (curves[i].dashed) draw_dashed(canvas, from, to, curves[i].colour, phase);
        else canvas.line(from, to, curves[i].colour, curve_width);
        canvas.text(left + legend_sample + legend_padding, y, curves[i].label, ink, text_scale);
    }
}

} // namespace

perception::Image draw(const LogLogPlot& plot) {
    Canvas canvas(plot.width, plot.height, paper);
    const Axes axes(plot);
    draw_grid(canvas, plot, axes);
    for (const Curve& curve : plot.curves) draw_curve(canvas, curve, axes);
    draw_legend(canvas, plot.curves, axes);
    canvas.text(axes.left(), 14, plot.title, ink, text_scale);
    const int centre = (axes.left() + axes.right() - Canvas::text_width(plot.x_label, text_scale)) / 2;
    canvas.text(centre, plot.height - 24, plot.x_label, ink, text_scale);
    const int middle = (axes.top() + axes.bottom() + Canvas::text_width(plot.y_label, text_scale)) / 2;
    canvas.text_upward(8, middle, plot.y_label, ink, text_scale);
    return canvas.image();
}

} // namespace unseen::app
