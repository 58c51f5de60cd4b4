// What folds change under lights, measured once for all of them: what the fold test by errors goes by where a tree's
// own light is not the scene's.
#pragma once

#include <optional>

#include <unseen/vdtree/lighting.h>

namespace unseen::perception {

// A light from l makes a max(0, n.l) of a vertex with the albedo a and the normal n. So what a light makes of a fold
// follows from what the fold changes of the vector a n. Where that is no more than v_k along each axis, the light
// changes by no more than its luminance times the sum of |l_k| v_k. The three v_k are measured as measure_folds()
// measures luminance. So is what changes of a, for ambient light. And pictures of the whole mesh, folded in stages, are
// taken under lights from all around. Copies are cheap and share their data.
class LitFolds {
public:
    // Fails where measure_folds() does. Cost: twice to three times that of it.
    static Result<LitFolds> measure(const vdtree::VertexTree& tree, int threads = 0, const Progress& progress = {});

    // What with_attributes() has kept in a tree. Fails where the tree has none of it (invalid_argument), where other
    // settings measured it (unsupported), and on what is damaged (malformed_data). Cost: as LightBounds::measure().
    static Result<LitFolds> of(const vdtree::VertexTree& tree);
    // The tree with all of this as attributes (lit_folds, lit_facing, lit_stage, lit_stages, lit_albedo and
    // lit_measurement;
    // docs/file-format.md), which files keep. Light does not count: the tree's own may be another one than the measured
    // tree's, though relit() and its like drop all attributes. Fails where the tree is another one.
    Result<vdtree::VertexTree> with_attributes(const vdtree::VertexTree& tree) const;

    // The tree under these lights, which stand still: luminances are lit_luminance() of leaves and proxies, and folds
    // change what they do at most from whichever side the light comes. For error_distances(), whose cuts are the given
    // tree's. Near lights fall off within a ring, and spots end there: what that adds is bounded, too. Highlights follow
    // the eye: for one eye (relative to the tree's origin), a fold counts as a change by the whole range that highlights
    // have over its ring, and there are no stages. `tree`: the measured one, or another handle. Fails where validate()
    // does, and on highlights without an eye (unsupported). Cost: some 0.3 us a node, in parallel.
    Result<vdtree::VertexTree> under(const vdtree::VertexTree& tree, const vdtree::Lighting& lighting,
                                     std::optional<glm::dvec3> eye = {}) const;

private:
    struct State;
    explicit LitFolds(std::shared_ptr<const State> state) : state_(std::move(state)) {}
    std::shared_ptr<const State> state_;
};

// Whether with_attributes() was there. What files say is looked at in LitFolds::of().
bool has_lit_folds(const vdtree::VertexTree& tree);

// The numbers that such a measurement goes by. LitFolds::of() refuses those of another one.
std::span<const float> lit_measurement_settings() noexcept;

} // namespace unseen::perception
