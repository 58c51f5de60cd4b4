// Nodes that one view hides, found from the depth of each pixel. For pictures of that view alone, hidden nodes fold.
#pragma once

#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>
#include <unseen/vdtree/view.h>

namespace unseen::vdtree {

struct Footprint; // the part of a window that a node covers

// Copies are cheap and share their data; any number of threads may ask at once.
class DepthPicture {
public:
    // `depth`: by pixel, row-major from the top left, the farthest depth that any sample of it shows, along the view's axis
    // in world units; infinite for the background. Fails on an invalid view, another number of pixels, and depths that are
    // NaN or not above 0. Cost: some nanoseconds and 6 bytes a pixel.
    static Result<DepthPicture> create(const View& view, std::span<const float> depth);

    const View& view() const noexcept { return levels_->view; }

    // Whether the footprint is hidden: all its pixels, and one pixel around, show something nearer. Outside the window
    // everything is hidden. A footprint that contains a visible one is visible.
    bool hides(const Footprint& footprint) const noexcept;

private:
    struct Level {
        int width = 0, height = 0;
        std::vector<float> farthest; // of 2 x 2 of the level before
    };
    struct Levels {
        View view;
        std::vector<Level> levels;
    };
    explicit DepthPicture(std::shared_ptr<const Levels> levels) : levels_(std::move(levels)) {}
    float farthest(int left, int top, int right, int bottom) const noexcept; // pixels, inclusive

    std::shared_ptr<const Levels> levels_;
};

// The interior nodes that the picture hides, before and after their folds, with all below them; one bit a node, lowest
// first. Fails if VertexTree::check() fails. Cost: some 50 ns a triangle, and 40 bytes a node meanwhile.
Result<std::vector<std::uint64_t>> find_hidden(const VertexTree& tree, const Similarity& placement,
                                               const DepthPicture& picture);

// The criterion with these nodes folding at no cost. Valid for views that see no more of the tree than the picture's. Fails
// for criteria with lights (invalid_argument). Cost: some nanoseconds and 4 bytes a node.
Result<DistanceCriterion> folding_hidden(const VertexTree& tree, const DistanceCriterion& criterion,
                                         std::span<const std::uint64_t> hidden);

} // namespace unseen::vdtree
