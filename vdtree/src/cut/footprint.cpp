#include <unseen/vdtree/depth_picture.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/parallel.h>

namespace unseen::vdtree {

void Footprint::add(const Footprint& other) noexcept {
    left = std::min(left, other.left), top = std::min(top, other.top);
    right = std::max(right, other.right), bottom = std::max(bottom, other.bottom);
    nearest = std::min(nearest, other.nearest);
}

Projector::Projector(const View& view)
    : eye_(view.eye), camera_(camera_frame(view)), middle_x_(axis_px(view).x), middle_y_(axis_px(view).y),
      focal_px_(view.height / (2 * std::tan(view.fov_y_degrees * std::numbers::pi / 360))) {}

Footprint Projector::operator()(glm::dvec3 point) const noexcept {
    const glm::dvec3 from_eye = point - eye_;
    const double along = -glm::dot(from_eye, camera_.back), scale = focal_px_ / along;
    if (!(along > 0)) return {.nearest = 0};
    const double x = middle_x_ + scale * glm::dot(from_eye, camera_.right);
    const double y = middle_y_ - scale * glm::dot(from_eye, camera_.up);
    return {x, y, x, y, along};
}

Result<std::vector<Footprint>> find_footprints(const VertexTree& tree, const Similarity& placement, const View& view) {
    if (const auto valid = validate_perspective(view, "What parts cover of a window"); !valid) return valid.error();
    const auto sound = SoundTree::of(tree);
    if (!sound) return sound.error();
    const NodeId interior = tree.interior_count();
    const Projector project(view);
    std::vector<Footprint> footprints(tree.node_count());
    parallel_loop(NodeId{0}, tree.node_count(), [&](NodeId node) {
        footprints[node] = project(placement.to_world(tree.origin() + glm::dvec3(tree.positions()[node])));
    });
    // Leaves: all triangles that touch them. From their own places, not from what has grown.
    std::vector<Footprint> leaves(footprints.begin() + interior, footprints.end());
    for (const Triangle& triangle : sound->triangles())
        for (const Index corner : triangle)
            for (const Index other : triangle) leaves[corner].add(footprints[interior + other]);
    std::copy(leaves.begin(), leaves.end(), footprints.begin() + interior);
    for (NodeId node = tree.node_count(); node-- > 1;) footprints[sound->parents()[node]].add(footprints[node]);
    footprints.resize(interior);
    return footprints;
}

} // namespace unseen::vdtree
