// Which nodes keep their outlines, as the lights see them, for their shadows would show it.
#pragma once

#include "fold_test.h"

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

// ---- outlines that stay, for their shadows would show it

// How shadows' edges are seen. Null where no light casts shadows. All objects that are seen alike share them.
Result<std::shared_ptr<const perception::ShadowEdges>> edges_of(Sight& sight, const Decision& decision, const Key& key);

// Where shadows count for a cut. Kept for views from nearby.
std::shared_ptr<const ShadowReach> reach_of(Sight& sight, const Decision& decision,
                                            const std::shared_ptr<const perception::ShadowEdges>& edges);

// Finds the outlines whose shadows would move visibly, for shadow_of(sight).kept. Returns whether these are others than
// before.
bool find_shadowing_outlines(Sight& sight, const Decision& decision, const std::shared_ptr<const KeptCriterion>& base);

// The criterion that keeps these outlines.
Result<std::shared_ptr<const vdtree::DistanceCriterion>>
keep_outlines(Sight& sight, const Decision& decision, const std::shared_ptr<const KeptCriterion>& base);

} // namespace unseen::session
