#include "accuracy_plot.h"

#include <algorithm>
#include <cmath>

#include "terminal.h"

namespace unseen::app {
namespace {

constexpr double margin_left = 70, margin_right = 20, margin_top = 16, margin_bottom = 46; // pixels around the axes
constexpr double letter_width = 0.6 * AccuracyPlot::text_height;                           // about

// A logarithmic axis with room for 0 at its beginning.
struct PlotScale {
    double least = 1, most = 10, from = 0, to = 1; // values above 0, and pixels
    bool has_zero = false;

    PlotScale(const std::vector<double>& values, double from_, double to_) : from(from_), to(to_) {
        std::vector<double> positive;
        for (const double v : values) {
            if (v > 0) positive.push_back(v);
            else has_zero = true;
        }
        if (positive.empty()) return;
        least = std::pow(10, std::floor(std::log10(*std::ranges::min_element(positive)) * 2) / 2);
        most = std::pow(10, std::ceil(std::log10(*std::ranges::max_element(positive)) * 2) / 2);
        if (!(most > least)) most = 10 * least;
    }
    double at(double value) const {
        constexpr double of_zero = 0.08; // share of the axis
        const double begin = has_zero ? from + of_zero * (to - from) : from;
        if (!(value > 0)) return from + (has_zero ? of_zero / 4 * (to - from) : 0);
        return begin + (to - begin) * std::log(value / least) / std::log(most / least);
    }
    std::vector<double> ticks() const {
        std::vector<double> all;
        for (double decade = std::pow(10, std::ceil(std::log10(least) - 1e-9)); decade <= most * (1 + 1e-9);
             decade *= 10)
            all.push_back(decade);
        return all;
    }
};

struct PlotBox {
    glm::dvec2 low, high;
    bool meets(const PlotBox& other) const {
        return low.x < other.high.x && other.low.x < high.x && low.y < other.high.y && other.low.y < high.y;
    }
    double overlap(const PlotBox& other) const {
        if (!meets(other)) return 0;
        return (std::min(high.x, other.high.x) - std::max(low.x, other.low.x)) *
               (std::min(high.y, other.high.y) - std::max(low.y, other.low.y));
    }
};

// Names beside their points, where they cover least of what is there: right or left, and up or down by lines.
void place_names(AccuracyPlot& plot, const std::vector<std::string>& names) {
    constexpr double line = AccuracyPlot::text_height + 1, gap = 6, radius = 4;
    std::vector<PlotBox> taken;
    for (const AccuracyPlot::Dot& dot : plot.dots) taken.push_back({dot.at - radius, dot.at + radius});
    for (std::size_t i = 0; i < names.size(); ++i) {
        const double width = letter_width * static_cast<double>(names[i].size());
        const glm::dvec2 at = plot.dots[i].at;
        double least = 1e300;
        AccuracyPlot::Text best;
        PlotBox best_box{};
        for (const int row : {0, -1, 1, -2, 2, -3, 3, -4, 4, -5, 5, -6, 6})
            for (const bool is_right : {true, false}) {
                const double top = at.y - AccuracyPlot::text_height / 2 + row * line;
                const double x = is_right ? at.x + gap : at.x - gap;
                const PlotBox box{{is_right ? x : x - width, top},
                                  {is_right ? x + width : x, top + AccuracyPlot::text_height}};
                constexpr double of_row = 12; // square pixels that are covered sooner than a line farther away
                double cost = of_row * std::abs(row);
                for (const PlotBox& other : taken) cost += box.overlap(other);
                const PlotBox inside{{margin_left, 0}, {AccuracyPlot::width, AccuracyPlot::height - margin_bottom}};
                cost += 4 * (width * AccuracyPlot::text_height - box.overlap(inside));
                if (cost >= least) continue;
                least = cost;
                best = {.at = {x, top},
                        .text = names[i],
                        .align = is_right ? PlotAlign::left : PlotAlign::right,
                        .is_name = true,
                        .is_default = plot.dots[i].is_default};
                best_box = box;
            }
        plot.texts.push_back(best);
        taken.push_back(best_box);
    }
}

} // namespace

std::string accuracy_number(double value) {
    if (std::isnan(value)) return "";
    if (std::isinf(value)) return "infinite";
    constexpr double whole = 1000; // from here on digits after the point say nothing
    if (std::abs(value) >= whole) return grouped(static_cast<std::uint64_t>(std::llround(value)));
    return value == 0 ? "0" : rounded(value, 3);
}

std::vector<std::string> subjects_of(const AccuracyBenchResult& result, const AccuracyAxis& axis) {
    std::vector<std::string> subjects;
    for (const AccuracyPoint& p : result.points)
        if (p.axis == axis.key && std::ranges::find(subjects, p.subject) == subjects.end())
            subjects.push_back(p.subject);
    return subjects;
}

std::vector<AccuracyPoint> points_of(const AccuracyBenchResult& result, const AccuracyAxis& axis,
                                     const std::string& subject) {
    std::vector<AccuracyPoint> points;
    for (const AccuracyPoint& p : result.points)
        if (p.axis == axis.key && p.subject == subject) points.push_back(p);
    return points;
}

AccuracyPlot lay_out(const AccuracyAxis& axis, const std::vector<AccuracyPoint>& all,
                     std::array<std::size_t, 2> columns) {
    std::vector<AccuracyPoint> points;
    for (const AccuracyPoint& p : all)
        if (std::isfinite(p.values[columns[0]]) && std::isfinite(p.values[columns[1]])) points.push_back(p);
    AccuracyPlot plot;
    if (points.empty()) return plot;
    const double right = AccuracyPlot::width - margin_right, bottom = AccuracyPlot::height - margin_bottom;
    std::vector<double> across, up;
    for (const AccuracyPoint& p : points) across.push_back(p.values[columns[0]]), up.push_back(p.values[columns[1]]);
    const PlotScale x(across, margin_left, right), y(up, bottom, margin_top);
    constexpr double half_text = AccuracyPlot::text_height / 2, tick_gap = 5;
    for (const double tick : x.ticks()) {
        plot.lines.push_back({{{x.at(tick), margin_top}, {x.at(tick), bottom}}});
        plot.texts.push_back(
            {.at = {x.at(tick), bottom + tick_gap}, .text = shortest(tick), .align = PlotAlign::centre});
    }
    for (const double tick : y.ticks()) {
        plot.lines.push_back({{{margin_left, y.at(tick)}, {right, y.at(tick)}}});
        plot.texts.push_back({.at = {margin_left - tick_gap, y.at(tick) - half_text},
                              .text = shortest(tick),
                              .align = PlotAlign::right});
    }
    if (x.has_zero) plot.texts.push_back({.at = {x.at(0), bottom + tick_gap}, .text = "0", .align = PlotAlign::centre});
    if (y.has_zero)
        plot.texts.push_back(
            {.at = {margin_left - tick_gap, y.at(0) - half_text}, .text = "0", .align = PlotAlign::right});
    plot.texts.push_back({.at = {0.5 * (margin_left + right), bottom + 22},
                          .text = axis.columns[columns[0]] + "   (upwards: " + axis.columns[columns[1]] + ")",
                          .align = PlotAlign::centre});
    const std::vector<bool> front = accuracy_front(points, columns);
    std::vector<glm::dvec2> path;
    std::vector<std::string> names;
    for (std::size_t i = 0; i < points.size(); ++i) {
        const glm::dvec2 at{x.at(across[i]), y.at(up[i])};
        if (front[i]) path.push_back(at);
        std::string tip = points[i].name + ": ";
        for (std::size_t c = 0; c < axis.columns.size(); ++c)
            if (!std::isnan(points[i].values[c]))
                tip += (c > 0 ? ", " : "") + accuracy_number(points[i].values[c]) + " " + axis.columns[c];
        plot.dots.push_back({.at = at,
                             .is_default = points[i].is_default,
                             .is_on_front = front[i],
                             .tip = tip + (points[i].note.empty() ? "" : " (" + points[i].note + ")")});
        names.push_back(points[i].name);
    }
    std::ranges::sort(path, {}, [](const glm::dvec2& p) { return p.x; });
    plot.lines.push_back({std::move(path), true});
    place_names(plot, names);
    return plot;
}

} // namespace unseen::app
