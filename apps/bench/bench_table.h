// The table of a benchmark: what was measured, beside what was promised.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "report.h"
#include "targets.h"

namespace unseen::app {

// One line of the table. A target is met where the value is at most as large, or at least.
struct BenchRow {
    std::string name, unit, note;
    std::optional<double> value; // none: not available, see the note
    Target target;
    bool more_is_better = false;
    int decimals = 0;
};

// A title, the rows in columns, and the notes below.
void print(const std::string& title, const std::vector<BenchRow>& rows);

Json to_json(const std::vector<BenchRow>& rows);

} // namespace unseen::app
