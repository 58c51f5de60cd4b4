// Levels selected beforehand, beside switching by area and by distance and the tree's own budget: what a flight shows of
// each, after tables 4.2 to 4.4 and 5.1 of Arlebrink and Linde (2018).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <unseen/session/selection.h>

#include "bench_table.h"

namespace unseen::app {

struct SelectionBenchOptions {
    std::vector<std::string> scenes;     // glTF files; empty: spheres, bunnies and models of `unseen make scene`
    std::vector<std::string> selections; // by scene; empty: made anew
    std::vector<std::string> statues;    // of the scenes that are made
    std::uint64_t scene_triangles = 0;   // of each of them; 0: as the kind has them
    std::uint64_t budget = 300'000;      // triangles
    int frames = 1000;
    int judged_every = 10;         // frames of which one is drawn and judged; levels follow all of them
    int width = 640, height = 360; // pixels
    int samples = 4;               // a pixel
    bool has_masked_tree = false;  // one more row, seconds a frame
    // By which levels are selected, each for itself; without `selections` alone.
    std::vector<session::SelectionQuality> qualities = {session::SelectionQuality::ssim};
    double spacing = 0;  // of the search's grid, as in session::PrecomputeOptions
    int window_px = 256; // of the search's cameras
};

struct SelectionBenchResult {
    std::vector<BenchTable> tables;
    Json json;
};

Result<SelectionBenchResult> bench_selection(const SelectionBenchOptions& options);

} // namespace unseen::app
