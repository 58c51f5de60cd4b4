// How a program hears of what its users may want to know: the library itself prints nothing.
#pragma once

#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/result.h>

namespace unseen::session {

// Called on the calling thread, during the call that has something to say. Each may be empty.
struct Messages {
    Callback<void(const Message&)> note = {};    // something takes long, and how to spare it
    Callback<void(const Message&)> warning = {}; // something is odd, and what is made of it
    Progress progress = {};                      // of reading, then of building, then of measuring; false cancels
};

} // namespace unseen::session
