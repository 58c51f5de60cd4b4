// What one view hides, by how far away is what it shows at each pixel: for pictures of that view, nodes behind it fold.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <unseen/vdtree/distance_criterion.h>
#include <unseen/vdtree/footprint.h>
#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>
#include <unseen/vdtree/view.h>

namespace unseen::vdtree {

// Copies are cheap and share their data; any number of threads may ask at once.
class DepthPicture {
public:
    // `depth`: by pixel of the view's window, row-major from the top left: how far along the view's axis, in world
    // units, the farthest is that any sample of the pixel shows; infinite where it may show the background. Fails on
    // an invalid view, another number of pixels, and depths that are NaN or not above 0. Cost: some nanoseconds and 6
    // bytes a pixel.
    static Result<DepthPicture> create(const View& view, std::span<const float> depth);

    const View& view() const noexcept { return levels_->view; }

    // Whether nothing between these points can be seen: at all pixels that they cover, and a pixel around, what is shown
    // is nearer than all of them. What is beside the window is not seen, either. A footprint that holds one that is seen
    // is seen.
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

// Which interior nodes' folds the picture hides, a bit a node, the first node's lowest: those of whose footprints it
// shows nothing (find_footprints()). Fails where VertexTree::check() does. Cost: some 50 ns a triangle, and 40 bytes a node meanwhile.
Result<std::vector<std::uint64_t>> find_hidden(const VertexTree& tree, const Similarity& placement,
                                               const DepthPicture& picture);

// The same criterion but for these nodes, which cost nothing. For this tree, and views that see no more of it than the
// picture's. Not of criteria with lights (invalid_argument). Cost: some nanoseconds and 4 bytes a node.
Result<DistanceCriterion> folding_hidden(const VertexTree& tree, const DistanceCriterion& criterion,
                                         std::span<const std::uint64_t> hidden);

} // namespace unseen::vdtree
