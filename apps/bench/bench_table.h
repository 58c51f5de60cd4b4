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

// What is printed: a title, columns of text, and notes below. Empty parts are left out.
struct BenchTable {
    std::string title = {};
    std::vector<std::vector<std::string>> rows = {}; // the first one is the header
    std::vector<std::string> notes = {};
};
BenchTable table_of(const std::string& title, const std::vector<BenchRow>& rows);

// To stdout: aligned for terminals, or as Markdown for pages.
enum class TableStyle { aligned, markdown };
void print(const BenchTable& table, TableStyle style);

Json to_json(const std::vector<BenchRow>& rows);

} // namespace unseen::app
