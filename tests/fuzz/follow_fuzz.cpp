// Fuzz target for cuts that follow a viewpoint: the bytes choose tree, criteria, viewpoints, options and all else that
// can be done with a cut (follow_drive.h); the cut has to stay what its definition asks for.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <string>

#include "follow_drive.h"
#include "target.h"

bool unseen::fuzz::accepts(std::string_view bytes) {
    const std::string fault =
        unseen::support::FollowDrive({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}).run();
    if (fault.empty()) return true;
    std::fprintf(stderr, "%s\n", fault.c_str());
    std::abort();
}
