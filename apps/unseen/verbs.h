// The verbs of the command `unseen`.
#pragma once

#include "command.h"

namespace unseen::app {

Command build_command(CLI::App& app);
Command demo_command(CLI::App& app);
Command info_command(CLI::App& app);
Command make_command(CLI::App& app);
Command scene_command(CLI::App& app);
Command lod_command(CLI::App& app);
Command select_command(CLI::App& app);
Command simplify_command(CLI::App& app);
Command render_command(CLI::App& app);
Command compare_command(CLI::App& app);
Command cache_command(CLI::App& app);
Command calibrate_command(CLI::App& app);
Command csf_command(CLI::App& app);
Command sheet_command(CLI::App& app);
Command study_command(CLI::App& app);
Command tradeoff_command(CLI::App& app);
Command view_command(CLI::App& app);

} // namespace unseen::app
