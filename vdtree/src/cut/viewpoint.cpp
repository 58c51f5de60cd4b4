#include <unseen/vdtree/criteria.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/errors.h>

namespace unseen::vdtree {

namespace {

// An orthographic view is taken as that of an eye far away: so far from the tree's far side, in heights of the window. A
// larger distance makes sizes more alike over the tree's depth and the spread's share of them smaller: both keep a
// thousandth more of a tree that fills the window. A smaller one leaves floats more digits at the window's edge.
constexpr double orthographic_distance = 2000;

// Around all that a tree shows in any cut; its own frame.
struct WholeSphere {
    glm::dvec3 centre;
    double radius;
};
WholeSphere whole_sphere(const VertexTree& tree) {
    const Sphere leaves = tree.bounding_sphere();
    WholeSphere all{glm::dvec3(leaves.centre), leaves.radius};
    if (tree.interior_count() == 0) return all;
    for (const Sphere& root : {tree.bounds()[VertexTree::root()].ring, tree.support_spheres()[VertexTree::root()]})
        all.radius =
            std::max(all.radius, glm::length(glm::dvec3(root.centre) - all.centre) + static_cast<double>(root.radius));
    return all;
}

// Midway between the eyes of two viewpoints, with half of their distance as spread.
Viewpoint between(const Viewpoint& a, const Viewpoint& b) {
    Viewpoint both = a;
    both.eye = a.eye + (b.eye - a.eye) * 0.5;
    constexpr double rounding = 1e-12; // of the middle and the distance, in doubles
    both.eye_spread = glm::length(b.eye - a.eye) * 0.5 + rounding * (glm::length(a.eye) + glm::length(b.eye)) +
                      std::max(a.eye_spread, b.eye_spread);
    both.frusta.insert(both.frusta.end(), b.frusta.begin(), b.frusta.end());
    return both;
}

glm::dvec3 back_in_tree(const View& view, const Similarity& placement) {
    return glm::normalize(placement.direction_to_mesh(camera_frame(view).back));
}

} // namespace

glm::dvec3 eye_in_tree(const VertexTree& tree, const View& view, const Similarity& placement) {
    const glm::dvec3 eye = placement.to_mesh(view.eye) - tree.origin();
    if (!view.orthographic_height) return eye;
    // On the window's axis, so far before the tree's far side that there a pixel is as large as it is in the view.
    const glm::dvec3 back = back_in_tree(view, placement);
    const WholeSphere all = whole_sphere(tree);
    const double far_side = glm::dot(eye - all.centre, back) + all.radius; // along the line of sight
    return eye + back * (orthographic_distance * *view.orthographic_height / placement.scale - far_side);
}

double pixels_per_radian(const View& view) {
    if (view.orthographic_height) return view.height * orthographic_distance;
    return view.height / (2 * std::tan(view.fov_y_degrees * std::numbers::pi / 360));
}

Frustum frustum_of(const VertexTree& tree, const View& view, const Similarity& placement) {
    const glm::dvec3 eye = eye_in_tree(tree, view, placement);
    Frustum planes;
    for (const glm::dvec3& inward : inward_of_window(view)) {
        const glm::dvec3 normal = glm::normalize(placement.direction_to_mesh(inward));
        planes.push_back({normal, -glm::dot(normal, eye)});
    }
    if (!view.orthographic_height) return planes;
    const double half_up = *view.orthographic_height / 2 / placement.scale,
                 half_right = half_up * view.width / view.height;
    const glm::dvec3 middle = placement.to_mesh(view.eye) - tree.origin();
    // Heights over these planes are summed in floats from products as large as the eye's distance: a few roundings of it.
    constexpr double float_rounding = 1e-6;
    const WholeSphere all = whole_sphere(tree);
    const double inexact = float_rounding * (glm::length(eye - all.centre) + all.radius);
    for (std::size_t i = 0; i < planes.size(); ++i)
        planes[i].offset = (i < 2 ? half_right : half_up) + inexact - glm::dot(planes[i].normal, middle);
    return planes;
}

Viewpoint viewpoint_of(const VertexTree& tree, const View& view, const Similarity& placement, bool window_only) {
    if (view.eye_distance != 0) {
        const auto [left, right] = eyes_of(view);
        return between(viewpoint_of(tree, left, placement, window_only),
                       viewpoint_of(tree, right, placement, window_only));
    }
    Viewpoint viewpoint;
    viewpoint.eye = eye_in_tree(tree, view, placement);
    if (view.orthographic_height) {
        // Every point of the tree is seen along the axis from one of the eyes.
        const glm::dvec3 back = back_in_tree(view, placement);
        const WholeSphere all = whole_sphere(tree);
        const glm::dvec3 to = all.centre - viewpoint.eye;
        viewpoint.eye_spread = glm::length(to - back * glm::dot(to, back)) + all.radius;
    }
    if (window_only) viewpoint.frusta.push_back(frustum_of(tree, view, placement));
    return viewpoint;
}

Result<Viewpoint> viewpoint_of_pair(const VertexTree& tree, const View& left, const View& right,
                                    const Similarity& placement, bool window_only) {
    for (const View* view : {&left, &right})
        if (const auto valid = validate_one_eye(*view, "Each view of a pair"); !valid) return valid.error();
    if (left.orthographic_height.has_value() != right.orthographic_height.has_value())
        return invalid_argument("Of a stereo pair both views must be orthographic, or none.");
    if (left.orthographic_height && *left.orthographic_height != *right.orthographic_height)
        return invalid_argument("The orthographic views of a stereo pair must be equally high.");
    return between(viewpoint_of(tree, left, placement, window_only), viewpoint_of(tree, right, placement, window_only));
}

} // namespace unseen::vdtree
