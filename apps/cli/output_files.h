// What a command will write, looked at before it works: a wrong name must not cost minutes, nor a file. And what it has
// written.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <unseen/vdtree/internal/atomic_file.h>
#include <unseen/vdtree/result.h>

#include "options.h"

namespace unseen::app {

// Fails where an output is one of the inputs or another output, and where it could not be written. Names that are
// empty, or "-", are none. Outputs are left as they are; folders that they need are made.
Result<void> check_outputs(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs);

// One of them, to be written and committed later; nothing where the name is empty. Removes what a killed writer has left.
Result<std::optional<vdtree::AtomicFile>> open_if_named(const std::string& file);

// What a command that looks at a model reads.
std::vector<std::string> inputs_of(const std::string& model, const ViewOptions& view, const DisplayOptions& display);

// "wrote small.glb (1.2 MB)", a line each; names that are empty, or "-", are none.
void print_written(const std::vector<std::string>& files);

// Outputs that passed check_outputs() and are there.
std::vector<std::string> written_outputs();

// Folders that check_outputs() made and nothing went into, after a failure.
void remove_empty_made_folders();

} // namespace unseen::app
