// The accuracy benchmark's plots as a page of SVG, and as pictures.
#include "accuracy_bench.h"

#include <algorithm>
#include <filesystem>

#include "accuracy_plot.h"
#include "drawing.h"
#include "plot_style.h"
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

std::string svg_of(const AccuracyPlot& plot) {
    const auto number = [](double px) { return rounded(px, 4); };
    std::string svg = "<svg viewBox=\"0 0 " + number(AccuracyPlot::width) + " " + number(AccuracyPlot::height) +
                      "\" role=\"img\" xmlns=\"http://www.w3.org/2000/svg\">";
    for (const AccuracyPlot::Line& line : plot.lines) {
        std::string path;
        for (const glm::dvec2& p : line.points) path += (path.empty() ? "M" : "L") + number(p.x) + " " + number(p.y);
        svg += std::string("<path class=\"") + (line.is_front ? "front" : "grid") + "\" d=\"" + path + "\"/>";
    }
    for (const AccuracyPlot::Dot& dot : plot.dots)
        svg += "<circle cx=\"" + number(dot.at.x) + "\" cy=\"" + number(dot.at.y) + "\" r=\"4\" class=\"" +
               (dot.is_default    ? "default"
                : dot.is_on_front ? "best"
                                  : "other") +
               "\"><title>" + html_text(dot.tip) + "</title></circle>";
    constexpr double baseline = 0.85; // of the letters' height, from their top
    for (const AccuracyPlot::Text& text : plot.texts)
        svg += "<text x=\"" + number(text.at.x) + "\" y=\"" + number(text.at.y + baseline * AccuracyPlot::text_height) +
               "\" text-anchor=\"" +
               (text.align == PlotAlign::left     ? "start"
                : text.align == PlotAlign::centre ? "middle"
                                                  : "end") +
               "\"" + (text.is_name ? " class=\"name\"" : "") + ">" + html_text(text.text) + "</text>";
    return svg + "</svg>";
}

std::string html_table(const AccuracyAxis& axis, const std::vector<AccuracyPoint>& points) {
    std::string html = "<table><tr><th></th>";
    for (const std::string& column : axis.columns) html += "<th>" + html_text(column) + "</th>";
    html += "<th></th><th></th></tr>";
    for (const AccuracyPoint& p : points) {
        html += "<tr><td>" + html_text(p.name) + "</td>";
        for (const double value : p.values) html += "<td class=\"n\">" + accuracy_number(value) + "</td>";
        html += std::string("<td>") + (p.is_on_front ? "front" : "") + (p.is_default ? " default" : "") + "</td><td>" +
                html_text(p.note) + "</td></tr>";
    }
    return html + "</table>";
}

constexpr const char* page_head = R"(<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>What accuracy costs</title><style>
body { font: 15px/1.5 sans-serif; max-width: 62em; margin: 2em auto; padding: 0 1em; color: #222; background: #fff }
svg { width: 100%; font: 10px sans-serif } .grid { stroke: #ddd; fill: none } .front { stroke: #36c; fill: none }
.name { fill: #444 } .default { fill: #c30 } .best { fill: #36c } .other { fill: #aaa }
table { border-collapse: collapse; font-size: 13px } td, th { padding: 2px 8px; text-align: left } .n { text-align: right }
tr:nth-child(even) { background: #f4f4f4 }
</style></head><body><h1>What accuracy costs</h1>
<p>Each point is a choice: to the left cheaper, below nearer to the truth. Blue is the front, of which nothing is both
cheaper and nearer; red is what the program does by default. Points tell more under the pointer.</p>
)";

void draw_plot(Drawing& drawing, const AccuracyPlot& plot, glm::dvec2 corner, const std::string& title) {
    constexpr glm::vec3 grid{0.87f}, blue{0.2f, 0.4f, 0.8f}, red{0.8f, 0.2f, 0}, grey{0.67f};
    drawing.text(corner + glm::dvec2(8, 4), title, plot_ink, AccuracyPlot::text_height + 2);
    const glm::dvec2 origin = corner + glm::dvec2(0, 18);
    for (const AccuracyPlot::Line& line : plot.lines) {
        std::vector<glm::dvec2> points;
        for (const glm::dvec2& p : line.points) points.push_back(origin + p);
        if (points.size() > 1) drawing.line(points, line.is_front ? blue : grid);
    }
    constexpr double dot_width = 7; // a line of no length with round ends
    for (const AccuracyPlot::Dot& dot : plot.dots)
        drawing.line(origin + dot.at, origin + dot.at, dot.is_default ? red : dot.is_on_front ? blue : grey, dot_width);
    for (const AccuracyPlot::Text& text : plot.texts)
        drawing.text(origin + text.at, text.text, text.is_default ? red : plot_ink, AccuracyPlot::text_height,
                     text.align == PlotAlign::left     ? Align::left
                     : text.align == PlotAlign::centre ? Align::centre
                                                       : Align::right);
}

} // namespace

std::string to_html(const AccuracyBenchResult& result) {
    std::string html = page_head;
    for (const AccuracyAxis& axis : result.axes) {
        html += "<h2>" + html_text(axis.name) + "</h2><p>" + html_text(axis.question) + "</p>";
        for (const std::string& subject : subjects_of(result, axis)) {
            const std::vector<AccuracyPoint> points = points_of(result, axis, subject);
            html += "<h3>" + html_text(subject) + "</h3>";
            for (const auto& columns : axis.plots) html += svg_of(lay_out(axis, points, columns));
            html += "<details><summary>as a table</summary>" + html_table(axis, points) + "</details>";
        }
        for (const AccuracyGap& gap : result.gaps)
            if (gap.axis == axis.key)
                html += "<p>Not measured of " + html_text(gap.subject) + ": " + html_text(gap.what) + "</p>";
    }
    return html + "</body></html>\n";
}

std::string accuracy_picture_name(const std::string& key) { return "accuracy_" + key + ".png"; }

Result<void> write_pictures(const AccuracyBenchResult& result, const std::string& folder) {
    constexpr int title_height = 18, width = static_cast<int>(AccuracyPlot::width),
                  height = static_cast<int>(AccuracyPlot::height) + title_height;
    for (const AccuracyAxis& axis : result.axes) {
        std::vector<std::string> subjects = subjects_of(result, axis);
        if (subjects.size() > 2) subjects = {subjects.front(), subjects.back()};
        auto drawing = Drawing::create(width, height * static_cast<int>(subjects.size()), plot_paper);
        if (!drawing) return drawing.error();
        for (std::size_t i = 0; i < subjects.size(); ++i)
            draw_plot(*drawing, lay_out(axis, points_of(result, axis, subjects[i]), axis.plots[0]),
                      {0, static_cast<double>(i) * height}, axis.name + ", " + subjects[i]);
        const auto written = drawing->write(std::filesystem::path(folder) / accuracy_picture_name(axis.key));
        if (!written) return written;
    }
    return {};
}

} // namespace unseen::app
