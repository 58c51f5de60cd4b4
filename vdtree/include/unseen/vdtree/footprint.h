// What parts of a model cover of a view's window.
#pragma once

#include <vector>

#include <glm/vec3.hpp>

#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>
#include <unseen/vdtree/view.h>

namespace unseen::vdtree {

// What points cover of the window, and how near they come. That of all of several points holds all between them.
struct Footprint {
    double left = 1e300, top = 1e300, right = -1e300, bottom = -1e300; // pixels
    double nearest = 1e300; // along the view's axis, world units; not above 0: beside or behind the eye

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

// By interior node: of the corners of all triangles that touch the support, of the node's proxy, and of those of all
// nodes under it. So of what is there before and after the fold, as long as the neighbours are unfolded, or the same is
// true of them. Fails where VertexTree::check() does,
// and for orthographic views. Cost: some 40 ns a triangle in parallel, and 40 bytes a node.
Result<std::vector<Footprint>> find_footprints(const VertexTree& tree, const Similarity& placement, const View& view);

} // namespace unseen::vdtree
