// Measures perception: what the fold tests save, whether anything of it can be seen, how good the models behind them
// are, and what they cost; against what was promised.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "bench_table.h"

namespace unseen::app {

inline constexpr const char* perception_groups[] = {"savings",   "aside", "random",    "far",  "hard",
                                                    "tolerance", "csf",   "observers", "speed"};

struct PerceptionBenchOptions {
    std::vector<std::string>
        meshes; // of all groups; empty: bunny and dragon where they are installed, or a sphere with bumps
    std::vector<std::string> others; // in the random views and far away, too
    std::vector<std::string> only;   // of perception_groups; empty: all
    std::string reference;           // a folder of published sensitivities; empty: the checkout's own
    std::string second_judge;        // its model of contrast sensitivity; empty: Barten's, fitted
    bool judges_on_gpu = false;
    int window_px = 1024;
    std::size_t random_views = 72;
    std::optional<std::uint64_t> seed; // of random views; none: drawn anew
    bool quick = false;                // few views
    Targets targets = Targets::built_in();
};

struct PerceptionBenchResult {
    std::string title;
    std::vector<BenchRow> rows;
    std::vector<BenchTable> details; // figures of the same things side by side
    Json views = Json::array();      // every view that was judged
};

// Needs OpenGL, but for the groups csf and observers.
Result<PerceptionBenchResult> bench_perception(const PerceptionBenchOptions& options);

// The groups that need no pictures (csf, observers): rows only.
struct SensitivityBenchOptions {
    std::string reference;
    bool quick = false;
    Targets targets = Targets::built_in();
};
Result<std::vector<BenchRow>> bench_csf(const SensitivityBenchOptions& options);
Result<std::vector<BenchRow>> bench_observers(const SensitivityBenchOptions& options);

} // namespace unseen::app
