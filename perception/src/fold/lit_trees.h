// One tree under different lights, and the errors of its folds under each.
#pragma once

#include <span>
#include <vector>

#include <unseen/perception/criterion.h>

#include "fold/fold_errors.h"

namespace unseen::perception {

// What folds change under some lights.
struct LitErrors {
    const vdtree::SoundTree* tree;
    std::span<const FoldError> errors;
    std::vector<vdtree::LightSource> casting = {}; // lights that cast shadows
    double largest_albedo = 1;

    // The largest step of relative luminance at the edge of a shadow; 0 without shadows.
    double edge_of_shadow(vdtree::NodeId node) const;
};

// Owns the trees and errors. Not to be copied: it refers to itself.
class LitTrees {
public:
    // Fails if there is no tree, if the trees differ in more than light, and if their measurements are damaged.
    static Result<LitTrees> of(std::span<const TreeAsLit> trees, const FoldModel& model);
    LitTrees(LitTrees&&) noexcept = default;
    LitTrees& operator=(LitTrees&&) noexcept = default;

    std::span<const LitErrors> as_lit() const { return lit_; }
    std::span<const FoldStage> stages() const { return stages_; } // the worst of any
    const vdtree::SoundTree& tree() const { return sound_.front(); }

private:
    LitTrees() = default;
    std::vector<vdtree::SoundTree> sound_;
    std::vector<FoldErrors> errors_;
    std::vector<LitErrors> lit_;
    std::vector<FoldStage> stages_;
};

} // namespace unseen::perception
