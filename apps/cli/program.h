// A program of verbs: finds the verb, runs it, and says in one sentence what went wrong.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <unseen/vdtree/function_ref.h>

#include "command.h"
#include "setup.h"

namespace unseen::app {

struct Program {
    const char* name = "";
    const char* about = "";                   // a sentence for --help
    const char* examples = "";                // below the verbs
    const char* version = "";                 // for --version
    std::map<std::string, std::string> hints; // verbs that people may look for here, and where they are
    const char* verb_for_files = nullptr;     // what people mean who give a file and no verb
    std::optional<Setup>* setup = nullptr;    // set when the verbs are added
    // Today's words for words of the command line that were valid once.
    void (*renew)(std::vector<std::string>& words) = nullptr;
};

// `verbs` adds them to the parser. Returns the exit status.
int run_program(int argc, char** argv, const Program& program,
                const FunctionRef<std::vector<Command>(CLI::App&)>& verbs);

} // namespace unseen::app
