// The test by errors, of errors that are given.
#pragma once

#include <span>
#include <vector>

#include <unseen/perception/criterion.h>

#include "fold/band_elevation.h"
#include "fold/fold_errors.h"

namespace unseen::perception {

// error_distances() of a tree whose errors these are: with sound arguments, and errors that are numbers and nest.
Result<vdtree::DistanceCriterion> criterion_of(const vdtree::SoundTree& tree, const FoldErrors& measured,
                                               const vdtree::View& view, const FoldTestOptions& options);

// What folds change under some lights.
struct LitErrors {
    const vdtree::SoundTree* tree;
    std::span<const FoldError> errors;
    std::vector<vdtree::LightSource> casting = {}; // that shadows may be of
    double largest_albedo = 1;

    // What is lost at the edges of shadows, of light that is met straight on, relative; 0 where there are none.
    double edge_of_shadow(vdtree::NodeId node) const;
};

// One tree under different lights, with what keeps it. Not to be copied: it refers to itself.
class LitTrees {
public:
    // Fails where there is none, where they are not of one tree, and where errors are none.
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

// error_distances() of these, where something masks what folds change, as parts of a criterion.
vdtree::DistanceCriterion::Parts criterion_parts(std::span<const LitErrors> as_lit, std::span<const FoldStage> stages,
                                                 const vdtree::View& view, const FoldTestOptions& options,
                                                 const BandElevation& masking);

} // namespace unseen::perception
