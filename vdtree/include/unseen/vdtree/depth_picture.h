// Nodes that one view hides, found from the depth of each pixel. For pictures of that view alone, hidden nodes fold.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>
#include <unseen/vdtree/view.h>

namespace unseen::vdtree {

// The part of the window that some points cover, and the nearest of them. The footprint of several points contains that of
// every point between them.
struct Footprint {
    double left = 1e300, top = 1e300, right = -1e300, bottom = -1e300; // pixels
    double nearest = 1e300; // along the view's axis, world units; 0 or less beside and behind the eye

    void add(const Footprint& other) noexcept;
};

// Projects points of the world onto a view's window.
class Projector {
public:
    explicit Projector(const View& view); // precondition: valid, and perspective
    Footprint operator()(glm::dvec3 point) const noexcept;

private:
    glm::dvec3 eye_;
    CameraFrame camera_;
    double middle_x_, middle_y_, focal_px_; // where the line of sight meets the window, and tangents in pixels
};

// By interior node: the footprint of its ring before and after the fold, and of all nodes below it. It holds as long as the
// neighbours are unfolded, or folded under the same rule. Fails if VertexTree::check() fails, and for orthographic views.
// Cost: some 40 ns a triangle in parallel, and 40 bytes a node.
Result<std::vector<Footprint>> find_footprints(const VertexTree& tree, const Similarity& placement, const View& view);

// Copies are cheap and share their data; any number of threads may ask at once.
class DepthPicture {
public:
    // `depth`: by pixel of the view's window, row-major from the top left, the farthest depth that any sample of the pixel
    // shows, along the view's axis in world units; infinite if it may show the background. Fails on an invalid view,
    // another number of pixels, and depths that are NaN or not above 0. Cost: some nanoseconds and 6 bytes a pixel.
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

// The interior nodes whose footprints the picture hides, one bit a node, lowest first. Fails like find_footprints(). Cost:
// some 50 ns a triangle, and 40 bytes a node meanwhile.
Result<std::vector<std::uint64_t>> find_hidden(const VertexTree& tree, const Similarity& placement,
                                               const DepthPicture& picture);

// The criterion with these nodes folding at no cost. Valid for views that see no more of the tree than the picture's. Fails
// for criteria with lights (invalid_argument). Cost: some nanoseconds and 4 bytes a node.
Result<DistanceCriterion> folding_hidden(const VertexTree& tree, const DistanceCriterion& criterion,
                                         std::span<const std::uint64_t> hidden);

} // namespace unseen::vdtree
