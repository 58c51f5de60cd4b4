// What a command will write, looked at before it works: a wrong name must not cost minutes, nor a file.
#pragma once

#include <string>
#include <vector>

#include <vdtree/result.h>

#include "options.h"

namespace unseen::app {

// Fails where an output is one of the inputs or another output, and where it could not be written. Names that are
// empty, or "-", are none. Outputs are left as they are.
Result<void> check_outputs(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs);

// What a command that looks at a model reads.
std::vector<std::string> inputs_of(const std::string& model, const ViewOptions& view, const DisplayOptions& display);

} // namespace unseen::app
