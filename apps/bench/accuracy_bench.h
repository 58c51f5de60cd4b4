// What accuracy costs: error against cost for the choices that the program makes, each by something else than what is
// varied.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "bench_table.h"

namespace unseen::app {

struct AccuracyBenchOptions {
    std::vector<std::string> models = {}; // meshes, trees and scenes; none: what is installed, and made scenes
    bool has_scenes = false;              // the made ones, too, where there are models
    std::vector<std::string> only = {};   // keys of axes; none: all
    double seconds = 300;                 // for each model's ways to fold, at most
    int samples = 64;                     // of pictures that are judged
    int window_px = 512;
    std::uint64_t scene_triangles = 200'000; // of each made scene, about
    int repeats = 9;                         // of what is timed
    std::size_t nodes = 2000;                // of each model, whose bounds are looked at
};

struct AccuracyAxis {
    std::string key;      // of --only, and in names of files
    std::string name;     // for people
    std::string question; // what it is about, in a sentence
    // What is measured of a point, with units: what it costs, what it is off by, then more.
    std::vector<std::string> columns;
    std::vector<std::array<std::size_t, 2>> plots = {{0, 1}}; // columns, rightwards and upwards; less is better
};

// One choice of one axis.
struct AccuracyPoint {
    std::string axis = {}; // its key
    std::string subject = {}, name = {};
    std::vector<double> values = {}; // of the axis's columns; NaN: does not apply
    std::string note = {};
    bool is_default = false;
    bool is_on_front = false; // of its axis and subject no other costs less and is nearer to the truth

    double cost() const { return values[0]; }
    double error() const { return values[1]; }
};

// What was asked for and not measured.
struct AccuracyGap {
    std::string axis, subject; // as of points
    std::string what;          // names of points and why, as a sentence
};

struct AccuracyBenchResult {
    std::vector<AccuracyAxis> axes; // those that were asked for
    std::vector<AccuracyPoint> points;
    std::vector<AccuracyGap> gaps;
    std::vector<BenchTable> tables; // what the defaults buy, then an axis each
    Json json;
};

std::vector<std::string> accuracy_axis_keys();

// Needs OpenGL. Cost: a minute or two a model.
Result<AccuracyBenchResult> bench_accuracy(const AccuracyBenchOptions& options);

// Of the points of one axis and subject, by two columns: which no other beats in both. What is not finite beats nothing.
std::vector<bool> accuracy_front(const std::vector<AccuracyPoint>& points, std::array<std::size_t, 2> columns);

std::string to_csv(const AccuracyBenchResult& result);
// A page of its own, with a plot for each axis and subject; nothing is loaded from elsewhere.
std::string to_html(const AccuracyBenchResult& result);

// A picture for each axis that has points: of the first model and of the last one.
std::string accuracy_picture_name(const std::string& key); // accuracy_KEY.png
Result<void> write_pictures(const AccuracyBenchResult& result, const std::string& folder);

} // namespace unseen::app
