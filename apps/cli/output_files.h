// What a command will write, looked at before it works: a wrong name must not cost minutes, nor a file. And what it has
// written.
#pragma once

#include <string>
#include <vector>

#include <unseen/vdtree/result.h>

#include "options.h"
#include "report.h"

namespace unseen::app {

// Fails if an output is one of the inputs, a file that an input reads in turn (a texture of a model), or another output,
// and if it could not be written. Empty names and "-" are passed over. Outputs stay as they are; folders that they need
// are made, and what a killed writer has left in them is removed.
Result<void> check_outputs(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs);

// Checks all outputs, these and those of the report, and opens the report.
Result<JsonReport> open_report(const std::vector<std::string>& inputs, std::vector<std::string> outputs,
                               const std::string& json, const std::string& csv = {});

// A sentence about what a file holds, with the first input's name if it names none.
Message with_file_name(const Error& error);

// What a command that looks at a model reads.
std::vector<std::string> inputs_of(const std::string& model, const ViewOptions& view, const DisplayOptions& display);

// "wrote small.glb (1.2 MB)", a line each; names that are empty, or "-", are none.
void print_written(const std::vector<std::string>& files);

// Outputs that passed check_outputs() and are there.
std::vector<std::string> written_outputs();

// Removes the folders that check_outputs() made and that are empty, after a failure. Async-signal-safe.
void remove_empty_made_folders() noexcept;

} // namespace unseen::app
