#include "panel_plot.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <unseen/vdtree/internal/number_format.h>

#include "plot_style.h"

namespace unseen::app {
namespace {

constexpr glm::vec3 grid{0.85f};
constexpr double text_height = plot_text_height, text_gap = 6;                             // pixels
constexpr double margin_left = 96, margin_right = 30, margin_top = 46, margin_bottom = 62; // pixels
constexpr double gap = 36;          // pixels between panels, for their labels
constexpr double curve_width = 1.5; // pixels
constexpr double head_room = 1.05;

// 1, 2 or 5 times a power of ten, so that about `count` of them fill the range.
double tick_step(double range, int count) {
    const double least = range / count;
    const double decade = std::pow(10.0, std::floor(std::log10(least)));
    for (const double step : {1.0, 2.0, 5.0})
        if (step * decade >= least) return step * decade;
    return 10 * decade;
}

std::string number(double value) { // 1500000 -> 1.5M
    for (const auto& [scale, name] : {std::pair{1e9, "G"}, std::pair{1e6, "M"}, std::pair{1e3, "k"}})
        if (value >= scale) return rounded(value / scale, 4) + name;
    return rounded(value, 4);
}

struct Box {
    double left, top, right, bottom, x_end, y_end;
    glm::dvec2 place(double x, double y) const {
        return {left + x / x_end * (right - left), bottom - y / y_end * (bottom - top)};
    }
};

void draw_grid(Drawing& drawing, const Box& box) {
    const double y_step = tick_step(box.y_end, 4);
    for (int i = 0; i * y_step <= box.y_end * (1 + 1e-9); ++i) {
        const double y = box.place(0, i * y_step).y;
        drawing.line({box.left, crisp(y)}, {box.right, crisp(y)}, grid);
        drawing.text({box.left - text_gap, y - text_height / 2}, number(i * y_step), plot_ink, text_height,
                     Align::right);
    }
    const double x_step = tick_step(box.x_end, 10);
    for (int i = 0; i * x_step <= box.x_end * (1 + 1e-9); ++i) {
        const double x = crisp(box.place(i * x_step, 0).x);
        drawing.line({x, box.top}, {x, box.bottom}, grid);
    }
    drawing.line({box.left, crisp(box.bottom)}, {box.right, crisp(box.bottom)}, plot_ink);
    drawing.line({crisp(box.left), box.top}, {crisp(box.left), box.bottom}, plot_ink);
}

// A value alone between gaps is a dot.
void draw_curve(Drawing& drawing, const Box& box, const Panel& panel) {
    constexpr double label_room = 2; // above the box, so that a curve along its top is whole
    drawing.clip({0, box.top - label_room}, {drawing.width(), box.bottom - box.top + 2 * label_room});
    std::vector<glm::dvec2> run;
    const auto end_run = [&] {
        if (run.size() == 1) run.push_back(run.front());
        if (!run.empty()) drawing.line(run, panel.colour, curve_width);
        run.clear();
    };
    for (std::size_t i = 0; i < panel.values.size(); ++i) {
        if (std::isfinite(panel.values[i])) run.push_back(box.place(static_cast<double>(i), panel.values[i]));
        else end_run();
    }
    end_run();
    drawing.end_clip();
}

// What a panel's values come to.
struct Summary {
    std::vector<double> settled;
    double first_largest = -std::numeric_limits<double>::infinity(); // of those before

    Summary(const Panel& panel, std::size_t settled_from) {
        const std::size_t begin = settled_from < panel.values.size() ? settled_from : 0; // of very short ones, all
        for (std::size_t i = 0; i < panel.values.size(); ++i) {
            if (!std::isfinite(panel.values[i])) continue;
            if (i < begin) first_largest = std::max(first_largest, panel.values[i]);
            else settled.push_back(panel.values[i]);
        }
    }
    double largest() const { return settled.empty() ? 0 : *std::max_element(settled.begin(), settled.end()); }
    double median() {
        const auto middle = settled.begin() + static_cast<std::ptrdiff_t>(settled.size() / 2);
        std::nth_element(settled.begin(), middle, settled.end());
        return *middle;
    }
};

void draw_panel(Drawing& drawing, const Box& box, const Panel& panel, Summary summary) {
    draw_grid(drawing, box);
    draw_curve(drawing, box, panel);
    std::string label = panel.label;
    if (!summary.settled.empty()) {
        const double median = summary.median(), y = box.place(0, median).y;
        drawing.line({box.left, y}, {box.right, y}, panel.colour, 1, true);
        label += "   median " + number(median) + ", largest " + number(summary.largest());
        if (summary.first_largest > box.y_end) label += ", at first " + number(summary.first_largest);
    }
    const double height = Drawing::fitting_height(label, text_height, box.right - box.left);
    drawing.text({box.left, box.top - text_height - text_gap}, label, panel.colour, height);
}

} // namespace

int height_of(const PanelPlot& plot) {
    return static_cast<int>(margin_top + static_cast<double>(plot.panels.size()) * (plot.panel_height + gap) +
                            margin_bottom);
}

void draw(const PanelPlot& plot, Drawing& drawing) {
    const double room = plot.width - 2 * margin_right, middle = plot.width / 2.0;
    drawing.text({middle, 12}, plot.title, plot_ink, Drawing::fitting_height(plot.title, text_height, room),
                 Align::centre);
    Box box{margin_left, margin_top, plot.width - margin_right, margin_top, 1, 1};
    for (const Panel& panel : plot.panels) {
        const Summary summary(panel, plot.settled_from);
        box.x_end = std::max(1.0, static_cast<double>(panel.values.size()) - 1);
        box.y_end = summary.largest() > 0 ? summary.largest() * head_room : 1;
        box.top = box.bottom + gap;
        box.bottom = box.top + plot.panel_height;
        draw_panel(drawing, box, panel, summary);
    }
    const double x_step = tick_step(box.x_end, 10);
    for (int i = 0; i * x_step <= box.x_end * (1 + 1e-9); ++i)
        drawing.text({box.place(i * x_step, 0).x, box.bottom + text_gap}, number(i * x_step), plot_ink, text_height,
                     Align::centre);
    drawing.text({middle, height_of(plot) - text_height - 12}, plot.x_label, plot_ink, text_height, Align::centre);
}

Result<void> write_plot(const std::filesystem::path& file, const PanelPlot& plot) {
    auto drawing = Drawing::create(plot.width, height_of(plot), plot_paper);
    if (!drawing) return drawing.error();
    draw(plot, *drawing);
    return drawing->write(file);
}

} // namespace unseen::app
