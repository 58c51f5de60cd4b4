// The verbs of the command `unseen`.
#pragma once

#include <functional>

#include <CLI/CLI.hpp>

#include <vdtree/result.h>

namespace unseen::app {

inline constexpr int exit_done = 0;
inline constexpr int exit_failed = 1;
inline constexpr int exit_usage = 2;

// A verb: its options, which its parser checks as far as they can be checked without reading a file (impossible ones
// end the parse), and the work, which returns the exit status.
struct Command {
    CLI::App* parser = nullptr;
    std::function<Result<int>()> run;
};

Command bench_command(CLI::App& app);
Command build_command(CLI::App& app);
Command info_command(CLI::App& app);
Command make_command(CLI::App& app);
Command simplify_command(CLI::App& app);
Command render_command(CLI::App& app);
Command compare_command(CLI::App& app);
Command calibrate_command(CLI::App& app);
Command csf_command(CLI::App& app);
Command sheet_command(CLI::App& app);
Command view_command(CLI::App& app);

} // namespace unseen::app
