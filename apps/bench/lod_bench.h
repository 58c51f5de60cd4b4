// Levels of detail beside those of meshoptimizer's simplification, of the same numbers of triangles, at the same
// distances: what people would see when engines switch.
#pragma once

#include <string>
#include <vector>

#include "bench_table.h"

namespace unseen::app {

struct LodBenchResult {
    BenchTable table;
    Json rows = Json::array();
};

// Of each model's levels, from the sides that they were looked at from: pixels that either judge sees, of all sides
// together. Textures as `unseen lod` has them. Needs OpenGL, and meshoptimizer for the comparison.
Result<LodBenchResult> bench_lod(const std::vector<std::string>& models, int levels);

} // namespace unseen::app
