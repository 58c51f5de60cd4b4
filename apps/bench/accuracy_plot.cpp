// The accuracy benchmark's pictures: error against cost.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "accuracy.h"
#include "benches.h"
#include "drawing.h"
#include "log_scale.h"
#include "plot_style.h"
#include "terminal.h"

namespace unseen::app {
namespace {

constexpr double plot_width = 760, plot_height = 360, title_height = 18, text_height = 10; // pixels
constexpr double margin_left = 70, margin_right = 20, margin_top = 16, margin_bottom = 46; // around the axes
constexpr glm::vec3 grid{0.87f}, blue{0.2f, 0.4f, 0.8f}, red{0.8f, 0.2f, 0}, grey{0.67f};

struct PlotBox {
    glm::dvec2 low, high;
    double overlap(const PlotBox& other) const {
        const glm::dvec2 size = glm::min(high, other.high) - glm::max(low, other.low);
        return size.x > 0 && size.y > 0 ? size.x * size.y : 0;
    }
};

struct PlotName {
    std::string text;
    glm::dvec2 dot; // beside which it is
    bool is_default;
};

// Names beside their points, where they cover least of what is there: right or left, and up or down by lines.
void draw_names(Drawing& drawing, glm::dvec2 origin, const std::vector<PlotName>& names) {
    constexpr double line = text_height + 1, gap = 6, radius = 4, letter_width = 0.6 * text_height;
    const PlotBox inside{{margin_left, 0}, {plot_width, plot_height - margin_bottom}};
    std::vector<PlotBox> taken;
    for (const PlotName& name : names) taken.push_back({name.dot - radius, name.dot + radius});
    for (const PlotName& name : names) {
        const double width = letter_width * static_cast<double>(name.text.size());
        double least = std::numeric_limits<double>::infinity();
        PlotBox best{};
        for (const int row : {0, -1, 1, -2, 2, -3, 3, -4, 4, -5, 5, -6, 6})
            for (const bool is_right : {true, false}) {
                const glm::dvec2 low{is_right ? name.dot.x + gap : name.dot.x - gap - width,
                                     name.dot.y - text_height / 2 + row * line};
                const PlotBox box{low, low + glm::dvec2(width, text_height)};
                constexpr double of_row = 12; // square pixels that are covered sooner than a line farther away
                double cost = of_row * std::abs(row) + 4 * (width * text_height - box.overlap(inside));
                for (const PlotBox& other : taken) cost += box.overlap(other);
                if (cost < least) least = cost, best = box;
            }
        const bool is_right = best.low.x > name.dot.x;
        drawing.text(origin + glm::dvec2(is_right ? best.low.x : best.high.x, best.low.y), name.text,
                     name.is_default ? red : plot_ink, text_height, is_right ? Align::left : Align::right);
        taken.push_back(best);
    }
}

void draw_plot(Drawing& drawing, glm::dvec2 corner, const std::string& title, const AccuracyAxis& axis,
               const AccuracyPoints& points) {
    drawing.text(corner + glm::dvec2(8, 4), title, plot_ink, text_height + 2);
    if (points.empty()) return;
    const glm::dvec2 origin = corner + glm::dvec2(0, title_height);
    const double right = plot_width - margin_right, bottom = plot_height - margin_bottom;
    std::vector<double> costs, errors;
    for (const AccuracyPoint& p : points) costs.push_back(p.cost()), errors.push_back(p.error());
    const LogScale x(costs, margin_left, right), y(errors, bottom, margin_top);
    constexpr double tick_gap = 5;
    const auto text = [&](glm::dvec2 at, const std::string& words, Align align) {
        drawing.text(origin + at, words, plot_ink, text_height, align);
    };
    const auto name_x = [&](double tick) { text({x.at(tick), bottom + tick_gap}, shortest(tick), Align::centre); };
    const auto name_y = [&](double tick) {
        text({margin_left - tick_gap, y.at(tick) - text_height / 2}, shortest(tick), Align::right);
    };
    for (const double tick : x.ticks()) {
        drawing.line(origin + glm::dvec2(x.at(tick), margin_top), origin + glm::dvec2(x.at(tick), bottom), grid);
        name_x(tick);
    }
    for (const double tick : y.ticks()) {
        drawing.line(origin + glm::dvec2(margin_left, y.at(tick)), origin + glm::dvec2(right, y.at(tick)), grid);
        name_y(tick);
    }
    if (x.has_zero) name_x(0);
    if (y.has_zero) name_y(0);
    text({0.5 * (margin_left + right), bottom + 22}, axis.columns[0] + "   (upwards: " + axis.columns[1] + ")",
         Align::centre);
    std::vector<glm::dvec2> front;
    std::vector<PlotName> names;
    for (const AccuracyPoint& p : points) {
        names.push_back({p.name, {x.at(p.cost()), y.at(p.error())}, p.is_default});
        if (p.is_on_front) front.push_back(origin + names.back().dot);
    }
    std::ranges::sort(front, {}, [](const glm::dvec2& p) { return p.x; });
    if (front.size() > 1) drawing.line(front, blue);
    constexpr double dot_width = 7; // a line of no length with round ends
    for (std::size_t i = 0; i < points.size(); ++i)
        drawing.line(origin + names[i].dot, origin + names[i].dot,
                     points[i].is_default    ? red
                     : points[i].is_on_front ? blue
                                             : grey,
                     dot_width);
    draw_names(drawing, origin, names);
}

} // namespace

std::string accuracy_number(double value) {
    if (std::isnan(value)) return "";
    if (std::isinf(value)) return "infinite";
    constexpr double whole = 1000; // from here on digits after the point say nothing
    if (std::abs(value) >= whole) return grouped(static_cast<std::uint64_t>(std::llround(value)));
    return value == 0 ? "0" : rounded(value, 3);
}

std::string accuracy_picture_name(const std::string& key) { return "accuracy_" + key + ".png"; }

void write_accuracy_pictures(const std::vector<const AccuracyAxis*>& axes, const AccuracyPoints& points,
                             const std::string& folder) {
    constexpr double height = plot_height + title_height;
    for (const AccuracyAxis* axis : axes) {
        std::vector<std::string> subjects;
        for (const AccuracyPoint& p : points)
            if (p.axis == axis && (subjects.empty() || subjects.back() != p.subject)) subjects.push_back(p.subject);
        if (subjects.size() > 2) subjects = {subjects.front(), subjects.back()};
        auto drawing = require(Drawing::create(
            static_cast<int>(plot_width), static_cast<int>(height) * static_cast<int>(subjects.size()), plot_paper));
        for (std::size_t i = 0; i < subjects.size(); ++i) {
            AccuracyPoints shown;
            std::ranges::copy_if(points, std::back_inserter(shown), [&](const AccuracyPoint& p) {
                return p.axis == axis && p.subject == subjects[i] && std::isfinite(p.cost()) &&
                       std::isfinite(p.error());
            });
            draw_plot(drawing, {0, static_cast<double>(i) * height}, axis->name + ", " + subjects[i], *axis, shown);
        }
        require(drawing.write(std::filesystem::path(folder) / accuracy_picture_name(axis->key)));
    }
}

} // namespace unseen::app
