#include <unseen/vdtree/criteria.h>

#include <cmath>
#include <numbers>

#include <glm/geometric.hpp>

#include "cut/orthographic.h"

namespace unseen::vdtree {

glm::dvec3 eye_in_tree(const VertexTree& tree, const View& view, const Similarity& placement) {
    const glm::dvec3 eye = placement.to_mesh(view.eye) - tree.origin();
    if (!view.orthographic_height) return eye;
    // On the window's axis, so far before the tree's far side that there a pixel is as large as it is in the view.
    const glm::dvec3 back = glm::normalize(placement.direction_to_mesh(camera_frame(view).back));
    const WholeSphere all = whole_sphere(tree);
    const double far_side = glm::dot(eye - all.centre, back) + all.radius; // along the line of sight
    return eye + back * (orthographic_distance * *view.orthographic_height / placement.scale - far_side);
}

double pixels_per_radian(const View& view) {
    if (view.orthographic_height) return view.height * orthographic_distance;
    return view.height / (2 * std::tan(view.fov_y_degrees * std::numbers::pi / 360));
}

} // namespace unseen::vdtree
