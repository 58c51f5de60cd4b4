// What takes part in making a cut and what does not, with reasons.
#pragma once

#include <optional>
#include <vector>

#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/geomorph.h>

#include "fold_test.h"

namespace unseen::session {

// What the cut itself says about them.
struct CutFacts {
    double imperceptible_from_m = 0;
    bool is_complete = true;   // no time limit ended it
    std::size_t occluders = 0; // how many spheres could hide something
    std::size_t outlines = 0;  // nodes that are kept for their shadows
};

// Without facts: as far as can be said before there is a cut.
std::vector<Effect> effects_of(const Sight& sight, const Decision& decision, const std::optional<CutFacts>& facts);
Effect geomorph_effect(const vdtree::Geomorph* geomorph, const vdtree::Cut& cut); // null: there is none

} // namespace unseen::session
