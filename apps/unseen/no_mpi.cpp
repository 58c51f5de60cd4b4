// A build without MPI: a process is alone, and several that do not know of each other must not write one file.
#include <cstdlib>
#include <string>

#include "process_team.h"

namespace unseen::app {

Result<std::unique_ptr<ProcessTeam>> ProcessTeam::join() {
    for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE"}) {
        const char* size = std::getenv(name);
        if (size && std::string(size) != "1")
            return Error{ErrorCode::unsupported, "This build cannot work in several processes, for it was made without "
                                                 "MPI; configure it with -DUNSEEN_WITH_MPI=ON, or start it once."};
    }
    return std::unique_ptr<ProcessTeam>();
}

bool ProcessTeam::is_there() noexcept { return false; }

} // namespace unseen::app
