// What the members of a team have to settle before they build.
#pragma once

#include <cstdint>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/internal/team.h>

namespace unseen::app {

// A number that differs, but for bad luck, where meshes or what is made of them differ.
std::uint64_t fingerprint(const vdtree::MeshView& mesh, vdtree::ClustererKind clusterer);

// All go on or none. Every member calls this, with what has gone wrong for it and the fingerprint of what it is to work
// on. All get the same answer: member 0's error, that of the first other one that has one, or that they do not have the
// same mesh.
Result<void> agree(vdtree::Team& team, const Result<void>& own, std::uint64_t fingerprint);

} // namespace unseen::app
