#include "log_log_plot.h"

#include <algorithm>
#include <cmath>

#include <unseen/vdtree/internal/number_format.h>

#include "plot_style.h"

namespace unseen::app {
namespace {

constexpr glm::vec3 faint{0.88f}, grid{0.75f};
constexpr double text_height = plot_text_height;
constexpr double margin = 12, tick_gap = 6, title_height = 46, legend_row = 24; // pixels
constexpr double legend_sample = 36, legend_padding = 12;                       // pixels
constexpr double curve_width = 2;                                               // pixels

// 1, 2 and 5 of every decade within the range.
std::vector<double> ticks(glm::dvec2 range) {
    constexpr double slack = 1 + 1e-9; // decimal powers are not exact
    std::vector<double> values;
    for (int decade = static_cast<int>(std::floor(std::log10(range.x))); decade <= std::log10(range.y); ++decade) {
        for (const double step : {1.0, 2.0, 5.0}) {
            const double value = step * std::pow(10.0, decade);
            if (value * slack >= range.x && value <= range.y * slack) values.push_back(value);
        }
    }
    return values;
}

bool is_decade(double value) {
    const double decades = std::log10(value);
    return std::abs(decades - std::round(decades)) < 1e-9;
}

std::string number(double value) { return rounded(value, 3); }

double widest(const std::vector<double>& values) {
    double most = 0;
    for (const double value : values) most = std::max(most, Drawing::text_width(number(value), text_height));
    return most;
}

double legend_width(const std::vector<Curve>& curves) {
    double most = 0;
    for (const Curve& curve : curves) most = std::max(most, Drawing::text_width(curve.label, text_height));
    return legend_sample + 3 * legend_padding + most;
}

// Where values lie in the picture: what the labels leave.
class Axes {
public:
    explicit Axes(const LogLogPlot& plot)
        : low_(std::log10(plot.x_range.x), std::log10(plot.y_range.x)),
          high_(std::log10(plot.x_range.y), std::log10(plot.y_range.y)),
          left_(margin + text_height + tick_gap + widest(ticks(plot.y_range)) + tick_gap), top_(title_height),
          right_(plot.width - legend_width(plot.curves)), bottom_(plot.height - margin - 2 * (text_height + tick_gap)) {
    }

    glm::dvec2 place(glm::dvec2 value) const {
        const glm::dvec2 share = (glm::dvec2(std::log10(value.x), std::log10(value.y)) - low_) / (high_ - low_);
        return {left_ + share.x * (right_ - left_), bottom_ - share.y * (bottom_ - top_)};
    }
    double left() const { return left_; }
    double top() const { return top_; }
    double right() const { return right_; }
    double bottom() const { return bottom_; }

private:
    glm::dvec2 low_, high_;
    double left_, top_, right_, bottom_;
};

void draw_grid(Drawing& drawing, const LogLogPlot& plot, const Axes& axes) {
    for (const double x : ticks(plot.x_range)) {
        const double at = axes.place({x, plot.y_range.x}).x;
        drawing.line({crisp(at), axes.top()}, {crisp(at), axes.bottom()}, is_decade(x) ? grid : faint);
        drawing.text({at, axes.bottom() + tick_gap}, number(x), plot_ink, text_height, Align::centre);
    }
    for (const double y : ticks(plot.y_range)) {
        const double at = axes.place({plot.x_range.x, y}).y;
        drawing.line({axes.left(), crisp(at)}, {axes.right(), crisp(at)}, is_decade(y) ? grid : faint);
        drawing.text({axes.left() - tick_gap, at - text_height / 2}, number(y), plot_ink, text_height, Align::right);
    }
    const glm::dvec2 a(crisp(axes.left()), crisp(axes.top())), b(crisp(axes.right()), crisp(axes.bottom()));
    const glm::dvec2 frame[] = {a, {b.x, a.y}, b, {a.x, b.y}, a};
    drawing.line(frame, plot_ink);
}

// Runs of points that are within the axes.
void draw_curve(Drawing& drawing, const Curve& curve, const LogLogPlot& plot, const Axes& axes) {
    const auto is_within = [](double value, glm::dvec2 range) { return value >= range.x && value <= range.y; };
    std::vector<glm::dvec2> run;
    const auto end_run = [&] {
        if (run.size() > 1) drawing.line(run, curve.colour, curve_width, curve.dashed);
        run.clear();
    };
    for (const glm::dvec2 point : curve.points) {
        if (is_within(point.x, plot.x_range) && is_within(point.y, plot.y_range)) run.push_back(axes.place(point));
        else end_run();
    }
    end_run();
}

// Rows come closer, and their text smaller, where there are many.
void draw_legend(Drawing& drawing, const std::vector<Curve>& curves, const Axes& axes) {
    const auto count =
        std::count_if(curves.begin(), curves.end(), [](const Curve& curve) { return !curve.label.empty(); });
    if (count == 0) return;
    const double row = std::min(legend_row, (axes.bottom() - axes.top()) / static_cast<double>(count));
    const double left = axes.right() + legend_padding, height = std::min(text_height, row);
    double top = axes.top();
    for (const Curve& curve : curves) {
        if (curve.label.empty()) continue;
        drawing.line({left, top + height / 2}, {left + legend_sample, top + height / 2}, curve.colour, curve_width,
                     curve.dashed);
        drawing.text({left + legend_sample + legend_padding, top}, curve.label, plot_ink, height);
        top += row;
    }
}

} // namespace

void draw(const LogLogPlot& plot, Drawing& drawing) {
    const Axes axes(plot);
    draw_grid(drawing, plot, axes);
    for (const Curve& curve : plot.curves) draw_curve(drawing, curve, plot, axes);
    draw_legend(drawing, plot.curves, axes);
    const double room = plot.width - axes.left() - margin;
    drawing.text({axes.left(), margin}, plot.title, plot_ink, Drawing::fitting_height(plot.title, text_height, room));
    const double x_height = Drawing::fitting_height(plot.x_label, text_height, axes.right() - axes.left());
    drawing.text({(axes.left() + axes.right()) / 2, plot.height - margin - text_height}, plot.x_label, plot_ink,
                 x_height, Align::centre);
    const double y_height = Drawing::fitting_height(plot.y_label, text_height, axes.bottom() - axes.top());
    drawing.text_upward({margin, (axes.top() + axes.bottom()) / 2}, plot.y_label, plot_ink, y_height, Align::centre);
}

Result<void> write_plot(const std::filesystem::path& file, const LogLogPlot& plot) {
    auto drawing = Drawing::for_file(file, plot.width, plot.height, plot_paper);
    if (!drawing) return drawing.error();
    draw(plot, *drawing);
    return drawing->write(file);
}

} // namespace unseen::app
