// A program of verbs: finds the verb, runs it, and says in one sentence what went wrong.
#pragma once

#include <map>
#include <string>
#include <vector>

#include <unseen/vdtree/function_ref.h>

#include "command.h"

namespace unseen::app {

struct Program {
    const char* name = "";
    const char* about = "";                   // a sentence for --help
    const char* examples = "";                // below the verbs
    const char* version = "";                 // for --version
    std::map<std::string, std::string> hints; // verbs that people may look for here, and where they are
};

// `verbs` adds them to the parser. Returns the exit status.
int run_program(int argc, char** argv, const Program& program,
                const FunctionRef<std::vector<Command>(CLI::App&)>& verbs);

} // namespace unseen::app
