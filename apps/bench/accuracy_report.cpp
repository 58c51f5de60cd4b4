// The page of the accuracy benchmark: a scatter plot for each axis and subject, drawn as text.
#include "accuracy_bench.h"

#include <algorithm>
#include <cmath>

#include "terminal.h"

namespace unseen::app {
namespace {

std::string html_text(const std::string& text) {
    std::string out;
    for (const char c : text) {
        if (c == '<') out += "&lt;";
        else if (c == '>') out += "&gt;";
        else if (c == '&') out += "&amp;";
        else if (c == '"') out += "&quot;";
        else out += c;
    }
    return out;
}

// Pixels: of plots, and of the margins around their axes.
constexpr double plot_width = 760, plot_height = 340, margin_left = 70, margin_right = 20, margin_top = 16,
                 margin_bottom = 46;

// A logarithmic axis with room for 0 at its beginning.
struct Scale {
    double least = 1, most = 10, from = 0, to = 1; // values above 0, and pixels
    bool has_zero = false;

    Scale(const std::vector<double>& values, double from_, double to_) : from(from_), to(to_) {
        std::vector<double> positive;
        for (const double v : values) {
            if (v > 0 && std::isfinite(v)) positive.push_back(v);
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

std::string text_at(double x, double y, const std::string& text, const char* anchor = "start", const char* more = "") {
    return "<text x=\"" + rounded(x, 5) + "\" y=\"" + rounded(y, 5) + "\" text-anchor=\"" + anchor + "\"" + more + ">" +
           html_text(text) + "</text>";
}

std::string plot_of(const AccuracyAxis& axis, const std::vector<AccuracyPoint>& points) {
    std::vector<double> times, errors;
    for (const AccuracyPoint& p : points) times.push_back(p.time), errors.push_back(p.error);
    const Scale x(times, margin_left, plot_width - margin_right), y(errors, plot_height - margin_bottom, margin_top);
    std::string svg = "<svg viewBox=\"0 0 " + rounded(plot_width, 4) + " " + rounded(plot_height, 4) +
                      "\" role=\"img\" xmlns=\"http://www.w3.org/2000/svg\">";
    for (const double tick : x.ticks())
        svg += "<path class=\"grid\" d=\"M" + rounded(x.at(tick), 5) + " " + rounded(margin_top, 4) + "V" +
               rounded(plot_height - margin_bottom, 5) + "\"/>" +
               text_at(x.at(tick), plot_height - margin_bottom + 14, rounded(tick, 2), "middle");
    for (const double tick : y.ticks())
        svg += "<path class=\"grid\" d=\"M" + rounded(margin_left, 4) + " " + rounded(y.at(tick), 5) + "H" +
               rounded(plot_width - margin_right, 5) + "\"/>" +
               text_at(margin_left - 6, y.at(tick) + 4, rounded(tick, 2), "end");
    if (y.has_zero) svg += text_at(margin_left - 6, y.at(0) + 4, "0", "end");
    if (x.has_zero) svg += text_at(x.at(0), plot_height - margin_bottom + 14, "0", "middle");
    svg += text_at(0.5 * (margin_left + plot_width - margin_right), plot_height - 10, axis.time_unit, "middle");
    // The front, from fast to exact.
    std::vector<const AccuracyPoint*> front;
    for (const AccuracyPoint& p : points)
        if (p.is_on_front) front.push_back(&p);
    std::ranges::sort(front, {}, [](const AccuracyPoint* p) { return p->time; });
    std::string path;
    for (const AccuracyPoint* p : front)
        path += (path.empty() ? "M" : "L") + rounded(x.at(p->time), 5) + " " + rounded(y.at(p->error), 5);
    if (!path.empty()) svg += "<path class=\"front\" d=\"" + path + "\"/>";
    for (const AccuracyPoint& p : points) {
        const double px = x.at(p.time), py = y.at(p.error);
        svg += "<circle cx=\"" + rounded(px, 5) + "\" cy=\"" + rounded(py, 5) + "\" r=\"4\" class=\"" +
               (p.is_default    ? "default"
                : p.is_on_front ? "best"
                                : "other") +
               "\"><title>" +
               html_text(p.name + ": " + rounded(p.time, 3) + ", " + (p.error == 0 ? "0" : rounded(p.error, 3)) +
                         (p.note.empty() ? "" : " (" + p.note + ")")) +
               "</title></circle>";
        const bool is_right = px > 0.7 * plot_width;
        svg += text_at(px + (is_right ? -7 : 7), py - 5, p.name, is_right ? "end" : "start", " class=\"name\"");
    }
    return svg + "</svg>";
}

std::string html_table(const AccuracyAxis& axis, const std::vector<AccuracyPoint>& points) {
    std::string html = "<table><tr><th></th><th>" + html_text(axis.time_unit) + "</th><th>" +
                       html_text(axis.error_unit) + "</th><th></th><th></th></tr>";
    for (const AccuracyPoint& p : points)
        html += "<tr><td>" + html_text(p.name) + "</td><td class=\"n\">" + rounded(p.time, 3) +
                "</td><td class=\"n\">" + (p.error == 0 ? "0" : rounded(p.error, 3)) + "</td><td>" +
                (p.is_on_front ? "front" : "") + (p.is_default ? " default" : "") + "</td><td>" + html_text(p.note) +
                "</td></tr>";
    return html + "</table>";
}

constexpr const char* head = R"(<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>What accuracy costs in time</title><style>
body { font: 15px/1.5 sans-serif; max-width: 60em; margin: 2em auto; padding: 0 1em; color: #222; background: #fff }
svg { width: 100%; font: 10px sans-serif } .grid { stroke: #ddd; fill: none } .front { stroke: #36c; fill: none }
.name { fill: #444 } .default { fill: #c30 } .best { fill: #36c } .other { fill: #aaa }
table { border-collapse: collapse; font-size: 13px } td, th { padding: 2px 8px; text-align: left } .n { text-align: right }
tr:nth-child(even) { background: #f4f4f4 }
</style></head><body><h1>What accuracy costs in time</h1>
<p>Each point is a choice: to the left faster, below nearer to the truth. Blue is the front, of which nothing is both faster
and nearer; red is what the program does by default. Points tell more under the pointer.</p>
)";

} // namespace

std::string to_html(const AccuracyBenchResult& result) {
    std::string html = head;
    for (const AccuracyAxis& axis : result.axes) {
        html += "<h2>" + html_text(axis.name) + "</h2><p>" + html_text(axis.question) +
                " Upwards: " + html_text(axis.error_unit) + ".</p>";
        std::vector<std::string> subjects;
        for (const AccuracyPoint& p : result.points)
            if (p.axis == axis.name && std::ranges::find(subjects, p.subject) == subjects.end())
                subjects.push_back(p.subject);
        for (const std::string& subject : subjects) {
            std::vector<AccuracyPoint> points;
            for (const AccuracyPoint& p : result.points)
                if (p.axis == axis.name && p.subject == subject) points.push_back(p);
            html += "<h3>" + html_text(subject) + "</h3>" + plot_of(axis, points) +
                    "<details><summary>as a table</summary>" + html_table(axis, points) + "</details>";
        }
    }
    return html + "</body></html>\n";
}

} // namespace unseen::app
