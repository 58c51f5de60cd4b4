// Measures the engine: cuts that follow a view, budgets, memory, building; against what was promised of it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "report.h"

namespace unseen::app {

struct EngineBenchOptions {
    std::string mesh;                 // empty: the dragon where quickstart has put it, else a sphere with bumps
    std::vector<std::uint64_t> sizes; // triangles, ascending; smaller ones than the mesh are simplified, larger ones subdivided
    std::string keep;                 // a folder for meshes and trees, used again where they are there; empty: none
    bool quick = false;               // few frames
};

// One line of the table. What is promised holds where the value is at most the bound, or at least.
struct BenchRow {
    std::string name, unit, note;
    std::optional<double> value; // none: not available, see the note
    std::optional<double> must, aim;
    bool more_is_better = false;
    int decimals = 0;
};

struct BenchResult {
    std::vector<BenchRow> rows;
    Json sizes = Json::array(); // what was measured at each size, for growth curves
    std::string mesh;
};

// Cuts are measured on one thread, pinned to one core, by the wall clock; medians. Trees are built by children of this
// program, whose peak memory that tells.
Result<BenchResult> bench_engine(const EngineBenchOptions& options);

} // namespace unseen::app
