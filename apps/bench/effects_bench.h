// What each effect of the perceptual test saves in triangles, and what it costs in time.
#pragma once

#include <string>
#include <vector>

#include "bench_table.h"

namespace unseen::app {

struct EffectsBenchOptions {
    std::vector<std::string> meshes; // or trees; empty: those of bench_perception
    bool quick = false;
};

struct EffectsBenchResult {
    BenchTable table; // a column for each mesh
    Json effects = Json::array();
};

// Each mesh from +Z, filling 90% of the default display's window, with the gaze 29 degrees aside: what is kept with
// everything that a fold test knows, and with one thing less or more. Times are of new cuts with their index buffers,
// in CPU time of one thread, medians.
Result<EffectsBenchResult> bench_effects(const EffectsBenchOptions& options);

} // namespace unseen::app
