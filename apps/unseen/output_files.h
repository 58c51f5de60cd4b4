// What a command will write, looked at before it works: a wrong name must not cost minutes, nor a file.
#pragma once

#include <initializer_list>
#include <string>

#include <vdtree/result.h>

namespace unseen::app {

// Fails where an output is one of the inputs or another output, and where it could not be written. Names that are empty, or "-", are
// none. Outputs are left as they are.
Result<void> check_outputs(std::initializer_list<std::string> inputs, std::initializer_list<std::string> outputs);

} // namespace unseen::app
