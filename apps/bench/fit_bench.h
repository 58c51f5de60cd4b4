// What other values of the fold model's factors would keep and show, on a tuning set that is not that of the evidence.
#pragma once

#include <string>
#include <vector>

#include "bench_table.h"

namespace unseen::app {

struct FitBenchOptions {
    std::string factor; // one of fit_factors(); empty: each
    bool quick = false; // few and small meshes, few views: rough figures
};

struct FitBenchResult {
    BenchTable table;
    Json rows = Json::array();
};

std::vector<std::string> fit_factors();

// One factor after the other takes other values, and the rest of the model its own. Of each value: the triangles that
// the test by errors keeps in all views of the tuning set, and what the first judge sees of that. Needs OpenGL.
Result<FitBenchResult> bench_fit(const FitBenchOptions& options);

} // namespace unseen::app
