// Verbs: what the commands `unseen` and `unseen-bench` are made of.
#pragma once

#include <functional>
#include <vector>

#include <CLI/CLI.hpp>

#include <unseen/vdtree/result.h>

#include "options.h"

namespace unseen::app {

inline constexpr int exit_done = 0;
inline constexpr int exit_failed = 1;
inline constexpr int exit_usage = 2;

// A verb: its options, which its parser checks as far as they can be checked without reading a file (impossible ones
// end the parse), and the work, which returns the exit status.
struct Command {
    CLI::App* parser = nullptr; // of the App given, which keeps it
    std::function<Result<int>()> run;
    std::vector<Rule> rules = {}; // which options go together
};

} // namespace unseen::app
