// What the folds of a tree show, and from how far.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <unseen/perception/criterion.h>

#include "fold/lit_trees.h"
#include "fold/switch_distances.h"

namespace unseen::perception {

// A pattern of a width, and its row of the table.
struct ShownFold {
    Pattern pattern;
    float length = 0; // mesh units
    std::uint16_t row = 0;
};
struct ShownFolds { // by interior node
    std::vector<ShownFold> patches, strips;
};

// What each fold shows, no less than its children's: a patch, and a strip where it is an outline. If one tree is given
// under several lights, the light that shows more counts. `highest_cpd`: what the display can show. Empty if there are
// more patterns than rows: then coarsen the rows and ask again.
std::optional<ShownFolds> find_shown(std::span<const LitErrors> as_lit, const FoldTestOptions& options,
                                     const CsfTable& csf, double highest_cpd, SwitchDistances& switch_distances);

// Gives a node its stage's pattern, one of `stages`, where that is seen from no farther than the node's own from
// anywhere, unless a child would then be seen from farther.
void fold_in_stages(const vdtree::SoundTree& tree, std::span<const FoldError> errors,
                    const SwitchDistances& switch_distances, std::span<const ShownFold> stages,
                    std::span<ShownFold> shown);

} // namespace unseen::perception
