// Several processes that build one tree together, however they talk to each other.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace unseen::vdtree {

// Communication between build_tree() on member 0 and help_build_tree() on all others. Called on the building thread only.
// If a member fails, members that wait for it wait for ever: the code that made the team must end them.
class Team {
public:
    virtual ~Team() = default;

    virtual int rank() const = 0; // 0 .. size() - 1
    virtual int size() const = 0;

    // Messages from one member to another arrive whole and in order. Both calls may wait for the other side.
    virtual void send(int to, std::span<const std::byte> message) = 0;
    virtual std::vector<std::byte> receive(int from) = 0;
};

} // namespace unseen::vdtree
