// Where things stand in a plot of the accuracy benchmark, for whatever draws it: a page, or a picture.
#pragma once

#include <string>
#include <vector>

#include <glm/vec2.hpp>

#include "accuracy_bench.h"

namespace unseen::app {

enum class PlotAlign { left, centre, right };

// Pixels from the top left.
struct AccuracyPlot {
    struct Line {
        std::vector<glm::dvec2> points;
        bool is_front = false; // else of the grid
    };
    struct Dot {
        glm::dvec2 at;
        bool is_default = false, is_on_front = false;
        std::string tip; // name, values and note
    };
    struct Text {
        glm::dvec2 at; // the letters' upper left corner, upper middle or upper right corner
        std::string text;
        PlotAlign align = PlotAlign::left;
        bool is_name = false; // of a point; else of the axes
        bool is_default = false;
    };
    static constexpr double width = 760, height = 360, text_height = 10;

    std::vector<Line> lines;
    std::vector<Dot> dots;
    std::vector<Text> texts;
};

// Of the points of one axis and subject, by two of the axis's columns: both logarithmic, with room for 0 at the
// beginning. Every point has its name, near it and not over another's.
AccuracyPlot lay_out(const AccuracyAxis& axis, const std::vector<AccuracyPoint>& points,
                     std::array<std::size_t, 2> columns);

// The subjects that an axis has points of, in order; and the points of one.
std::vector<std::string> subjects_of(const AccuracyBenchResult& result, const AccuracyAxis& axis);
std::vector<AccuracyPoint> points_of(const AccuracyBenchResult& result, const AccuracyAxis& axis,
                                     const std::string& subject);

std::string accuracy_number(double value); // for people; empty where it is NaN

} // namespace unseen::app
