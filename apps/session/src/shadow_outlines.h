// What the shadows of lights ask of a cut: outlines that stay, for their shadows would show it.
#pragma once

#include <memory>
#include <vector>

#include "kept_criterion.h"
#include "shadow_limit.h"

namespace unseen::session {

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
