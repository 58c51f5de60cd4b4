// A program run for what it does and for what it takes.
#pragma once

#include <string>
#include <vector>

#include <unseen/vdtree/result.h>

namespace unseen::app {

struct ChildOutcome {
    int status = 0;     // exit status; minus the signal that ended it
    double seconds = 0; // wall clock
    std::string out;    // stdout
};

// Runs a program (found by PATH if its name has no slash) and waits for it; its stderr is this one's. Fails if it cannot
// be started.
Result<ChildOutcome> run_child(std::vector<std::string> words);

} // namespace unseen::app
