// How models of contrast sensitivity, and observers, compare with people's thresholds; and the fits to these.
#pragma once

#include <string>
#include <vector>

#include "bench_table.h"

namespace unseen::app {

struct PeopleBenchResult {
    std::vector<BenchTable> tables;
    Json rows = Json::array();
};

// `file`: see calibration::read_sensitivities(). Errors: of reading it, and where no threshold is in the domain.
Result<PeopleBenchResult> bench_people(const std::string& file);

} // namespace unseen::app
