// The processes that `mpirun -np N unseen build ...` starts.
#pragma once

#include <cstdint>
#include <memory>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/internal/team.h>
#include <unseen/vdtree/result.h>

namespace unseen::app {

class ProcessTeam : public vdtree::Team {
public:
    // Begins to join the others, and goes on meanwhile: what depends on them waits. Null where no mpirun has started
    // this process. To be called once, before anything starts threads. Fails where mpirun has started several and this
    // build cannot talk to them. A member that ends without leave() takes the others with it.
    static Result<std::unique_ptr<ProcessTeam>> join();

    static bool is_there() noexcept; // this build can talk to others

    virtual int cores() const = 0; // that this machine has for all its members together
    virtual int members_on_machine() const = 0;

    // Nothing may be sent afterwards. The destructor waits, without using a core, until all members leave.
    virtual void leave() = 0;
};

// ---- what its members settle before they build

// A number that differs, but for bad luck, where meshes or what is made of them differ.
std::uint64_t fingerprint(const vdtree::MeshView& mesh, const vdtree::BuildOptions& options);

// All go on or none. Every member calls this, with what has gone wrong for it and the fingerprint of what it is to work
// on. All get the same answer: member 0's error, that of the first other one that has one, or that they do not have the
// same mesh.
Result<void> agree(vdtree::Team& team, const Result<void>& own, std::uint64_t fingerprint);

} // namespace unseen::app
