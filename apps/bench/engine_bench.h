// Measures the engine: cuts that follow a view, budgets, memory, building; against what was promised of it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "bench_table.h"

namespace unseen::app {

struct EngineBenchOptions {
    std::string mesh; // empty: the dragon where quickstart has put it, else a sphere with bumps
    std::vector<std::uint64_t>
        sizes;          // triangles, ascending; smaller ones than the mesh are simplified, larger ones subdivided
    std::string keep;   // a folder for meshes and trees, used again where they are there; empty: none
    bool quick = false; // few frames
    Targets targets = Targets::built_in();
};

struct EngineBenchResult {
    std::vector<BenchRow> rows;
    Json sizes = Json::array(); // what was measured at each size, for growth curves
    std::string mesh;
};

// Cuts are measured on one thread, pinned to one core, by the wall clock; medians. Trees are built by the command
// `unseen`, which lies beside this program or is found by PATH, and tells its peak memory.
Result<EngineBenchResult> bench_engine(const EngineBenchOptions& options);

} // namespace unseen::app
