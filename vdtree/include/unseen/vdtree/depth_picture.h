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

// How much of the surface at the leaves below a node a picture shows. By interior node; a node has no less than its
// children together.
struct ShownParts {
    std::vector<float> area;    // square pixels, of triangles; a third of each to each corner
    std::vector<float> outline; // pixels, of edges between what faces the eye and what does not; a half to each end
};

// Triangles count by the share of ten of their points that the picture does not hide. Borders are outlines.
// `only_front`: what faces away is not drawn, for closed surfaces. The picture must show the mesh, or a cut within a pixel
// of it. Fails if VertexTree::check() fails. Cost: some 400 ns a triangle.
Result<ShownParts> find_shown(const VertexTree& tree, const Similarity& placement, const DepthPicture& picture,
                              bool only_front);

} // namespace unseen::vdtree
