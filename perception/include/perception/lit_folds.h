// What folds change under lights, measured once for all of them: what the fold test by errors goes by where a tree's own
// light is not the scene's.
#pragma once

#include <memory>

#include <vdtree/function_ref.h>
#include <vdtree/lighting.h>
#include <vdtree/result.h>
#include <vdtree/vertex_tree.h>

namespace unseen::perception {

// A light from l makes a max(0, n.l) of a vertex with the albedo a and the normal n. So what a light makes of a fold
// follows from what the fold changes of the vector a n. Where that is no more than v_k along each axis, the light changes
// by no more than its luminance times the sum of |l_k| v_k. The three v_k are measured as measure_folds() measures
// luminance. So is what changes of a, for ambient light. Copies are cheap and share their data.
class LitFolds {
public:
    // Fails where measure_folds() does. Cost: three times its, or four where there are colours.
    static Result<LitFolds> measure(const vdtree::VertexTree& tree, int threads = 0, const Progress& progress = {});

    // The tree under these lights, which stand still: luminances are lit_luminance() of leaves and proxies, and folds
    // change what they do at most from whichever side the light comes. For error_distances(), whose cuts are the given
    // tree's. Near lights fall off within a ring, and spots end there: what that adds is bounded, too. `tree`: the
    // measured one, or another handle. Without stages. Fails where validate() does, and on highlights (unsupported),
    // which follow the eye. Cost: some 0.3 us a node, in parallel.
    Result<vdtree::VertexTree> under(const vdtree::VertexTree& tree, const vdtree::Lighting& lighting) const;

private:
    struct State;
    explicit LitFolds(std::shared_ptr<const State> state) : state_(std::move(state)) {}
    std::shared_ptr<const State> state_;
};

} // namespace unseen::perception
