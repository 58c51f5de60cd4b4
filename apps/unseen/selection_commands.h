// The parts of `unseen levels` for selections that are computed beforehand.
#pragma once

#include "command.h"
#include "setup.h"

namespace unseen::app {

Command precompute_command(CLI::App& levels, Setup& setup);
Command selection_info_command(CLI::App& levels);

} // namespace unseen::app
