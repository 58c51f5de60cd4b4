// Which nodes keep their outlines, as the lights see them, for their shadows would show it.
#pragma once

#include <cstdint>
#include <vector>

#include <unseen/session/scene.h>
#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/lighting.h>
#include <unseen/vdtree/vertex_tree.h>

#include "shadow_reach.h"

namespace unseen::session {

// Triangles that a ring shares with neighbours reach beyond it where these are folded, too, by no more than their size.
inline constexpr double cast_radii = 2;

// By interior node: by how much folding it may move an outline that a light sees, mesh units, no less than its
// children. `moved`: by how much folds move outlines; `facing`: the directions that nodes have in any cut. `lighting`:
// null: lights that may come from anywhere.
std::vector<float> outline_shifts(const vdtree::VertexTree& tree, std::span<const float> moved,
                                  std::span<const vdtree::NormalSlabs> facing, const vdtree::Lighting* lighting);

// A bit a node: those whose outlines may move farther than `share` of what goes unseen where their shadows may be. Half
// of that is left to what shadows fall on, which moves as well. Nodes above such a node are such. Cost: what lies above
// it, and some hundred nanoseconds a dozen nodes.
std::vector<std::uint64_t> shadowing_outlines(const Object& object, std::span<const float> shifts,
                                              const ShadowReach& reach, double share);

bool contains(std::span<const std::uint64_t> all, std::span<const std::uint64_t> some);
std::size_t count(std::span<const std::uint64_t> bits);

} // namespace unseen::session
