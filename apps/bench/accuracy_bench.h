// What accuracy costs in time: error against time for the choices that the program makes, each by something else than what
// is varied.
#pragma once

#include <string>
#include <vector>

#include "bench_table.h"

namespace unseen::app {

struct AccuracyBenchOptions {
    std::vector<std::string> models = {}; // meshes, trees and scenes; none: what is installed, and made scenes
    bool has_scenes = false;              // the made ones, too, where there are models
    double seconds = 45;                  // for each model's ways to fold
    int samples = 64;                     // of pictures that are judged
    int window_px = 512;                  // of scenes
    std::uint64_t scene_triangles = 200'000;
    int repeats = 9; // of what is timed
};

// One choice of one axis.
struct AccuracyPoint {
    std::string axis, subject, name;
    double time = 0;  // of the axis's own unit
    double error = 0; // likewise
    std::string note = {};
    bool is_default = false;
    bool is_on_front = false; // of its axis and subject no other is faster and nearer to the truth
};

struct AccuracyAxis {
    std::string name, time_unit, error_unit;
    std::string question; // what it is about, in a sentence
};

struct AccuracyBenchResult {
    std::vector<AccuracyAxis> axes;
    std::vector<AccuracyPoint> points;
    std::vector<BenchTable> tables; // the defaults first, then an axis each
    Json json;
};

// Needs OpenGL. Cost: a minute a model, and half a minute.
Result<AccuracyBenchResult> bench_accuracy(const AccuracyBenchOptions& options);

std::string to_csv(const AccuracyBenchResult& result);
// A page of its own, with a plot for each axis and subject; nothing is loaded from elsewhere.
std::string to_html(const AccuracyBenchResult& result);

} // namespace unseen::app
