// What folding a node gets wrong, by the model (<unseen/perception/criterion.h>), of what was measured of it
// (measure/fold_record.h).
#pragma once

#include <unseen/perception/criterion.h>

#include "measure/fold_record.h"

namespace unseen::perception {

// The error of folding an interior node instead of showing the mesh's own surface. The larger of two cases: neighbours
// folded as far as nodes no larger than it, or unfolded.
struct FoldError {
    // Mesh units. By how far an outline moves, no less than the children's; and the mean distance of points.
    float distance = 0, mean_distance = 0;
    // Likewise, by how far an open border moves, and the larger one of that and the distance.
    float border = 0, outline = 0;
    // Relative, 0..1: what bands of spatial frequency see, as the amplitude of a grating. A band sees no more than of a
    // patch as wide as the node of the amplitude `wide_luminance`, side by side with others like it of random signs,
    // and of parts 2^-k as wide of 4^k times that, up to `luminance`.
    float luminance = 0, wide_luminance = 0;
    // Of a ring narrower than its pictures' cells: its width, mesh units, and the amplitude of the light that moves across it.
    float thickness = 0, thin_luminance = 0;
    float extent = 0;           // mesh units: see FoldRecord; no less than the children's
    float bias = 0;             // see FoldRecord
    vdtree::NormalSlabs facing; // see FoldFacing; all where parts of the surface meet; it includes the children's
    std::uint8_t fading = 0;
    std::uint8_t stage = 0; // in which it folds: see FoldStage; no earlier than the children

    bool operator==(const FoldError&) const = default;
};

// The model's errors of measured folds, all of them numbers, without stages. Cost: one pass over the nodes.
std::vector<FoldError> nested_errors(const vdtree::SoundTree& tree, std::span<const FoldRecord> records,
                                     std::span<const FoldFacing> facing, std::span<const FoldTexture> textures = {},
                                     const FoldModel& model = {});

struct FoldErrors {
    std::vector<FoldError> of_nodes;
    std::span<const FoldStage> stages; // of the tree; empty where there are none
};

// For a tree from measure_folds(). Fails if it is not one, if it was measured with other settings, or if a value
// cannot come from measuring: attributes from files are first checked here.
Result<FoldErrors> fold_errors_of(const vdtree::SoundTree& tree, const FoldModel& model = {});

// What folds change under some lights.
struct LitErrors {
    const vdtree::SoundTree* tree;
    std::span<const FoldError> errors;
    std::vector<vdtree::LightSource> casting = {}; // lights that cast shadows
    double largest_albedo = 1;
    float colour_reach = 0;               // how far apart the colours of the tree and grey are, as luminance
    std::vector<float> colour_range = {}; // of rings, by interior node, as luminance; none: grey, or of a texture alone

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
