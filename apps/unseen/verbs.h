// The verbs of the command `unseen`.
#pragma once

#include "command.h"
#include "setup.h"

namespace unseen::app {

Command build_command(CLI::App& app, Setup& setup);
Command cache_command(CLI::App& app);
Command calibrate_command(CLI::App& app, Setup& setup);
Command compare_command(CLI::App& app, Setup& setup);
Command csf_command(CLI::App& app);
Command demo_command(CLI::App& app, Setup& setup);
Command fly_command(CLI::App& app, Setup& setup);
Command info_command(CLI::App& app, Setup& setup);
Command levels_command(CLI::App& app, Setup& setup);
Command lod_command(CLI::App& app, Setup& setup);
Command make_command(CLI::App& app, Setup& setup);
Command render_command(CLI::App& app, Setup& setup);
Command sheet_command(CLI::App& app, Setup& setup);
Command simplify_command(CLI::App& app, Setup& setup);
Command study_command(CLI::App& app, Setup& setup);
Command tradeoff_command(CLI::App& app, Setup& setup);
Command view_command(CLI::App& app, Setup& setup);

// Parts of `levels`.
Command precompute_command(CLI::App& levels, Setup& setup);
Command selection_info_command(CLI::App& levels);

} // namespace unseen::app
