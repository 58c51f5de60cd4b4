// Nodes that one view hides, found from the depth of each pixel. For pictures of that view alone, hidden nodes fold.
#pragma once

#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>
#include <unseen/vdtree/view.h>

namespace unseen::vdtree {

struct Footprint; // the part of a window that points cover

// Copies are cheap and share their data; any number of threads may ask at once.
class DepthPicture {
public:
    // `depth`: by pixel, row-major from the top left, the farthest depth that any sample of it shows, along the view's axis
    // in world units; infinite for the background. Fails on an invalid view, another number of pixels, and depths that are
    // NaN or not above 0. Cost: some nanoseconds and 6 bytes a pixel.
    static Result<DepthPicture> create(const View& view, std::span<const float> depth);

    const View& view() const noexcept { return levels_->view; }

    // Copies of one picture are equal; pictures that were made apart are not.
    friend bool operator==(const DepthPicture& a, const DepthPicture& b) noexcept { return a.levels_ == b.levels_; }

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

// The criterion with these nodes folding at no cost. Valid for views that see no more of the tree than the picture's. Fails
// for criteria with lights (invalid_argument). Cost: some nanoseconds and 4 bytes a node.
Result<DistanceCriterion> folding_hidden(const VertexTree& tree, const DistanceCriterion& criterion,
                                         std::span<const std::uint64_t> hidden);

// What pictures show of the surface at the leaves below a node. By interior node; a node has no less than its children
// together.
struct ShownParts {
    std::vector<float> area;    // square pixels, of triangles; a third of each to each corner
    std::vector<float> outline; // pixels, of edges between what faces the eye and what does not; half to each end

    // Adds what another picture shows, as many times as much. Precondition: both are of one tree.
    void add(const ShownParts& other, float areas, float outlines);
};

// Triangles count by the share of ten of their points that the picture does not hide. Borders are outlines. `only_front`:
// what faces away is not drawn, for closed surfaces. The picture must show the mesh, or a cut within a pixel of it. Fails if
// VertexTree::check() fails. Cost: some 0.5 us a triangle, in parallel.
Result<ShownParts> find_shown(const VertexTree& tree, const Similarity& placement, const DepthPicture& picture,
                              bool only_front);

// One bit a node, the lowest first: all that the node and what is below it change stays hidden, for the picture shows no
// point of any triangle that touches the node. This holds before anything folds, and after all hidden nodes have folded.
// Points of large triangles are as close as the pixels that are looked at around each. The rest is as for find_shown().
Result<std::vector<std::uint64_t>> find_hidden(const VertexTree& tree, const Similarity& placement,
                                               const DepthPicture& picture);

} // namespace unseen::vdtree
