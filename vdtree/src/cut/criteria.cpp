#include <unseen/vdtree/criteria.h>

#include <cmath>
#include <numbers>

namespace unseen::vdtree {

glm::dvec3 eye_in_tree(const VertexTree& tree, const View& view, const Similarity& placement) {
    return placement.to_mesh(view.eye) - tree.origin();
}

double pixels_per_radian(const View& view) {
    return view.height / (2 * std::tan(view.fov_y_degrees * std::numbers::pi / 360));
}

FrustumVisibility::FrustumVisibility(const VertexTree& tree, const View& view, const Similarity& placement)
    : frustum_(frustum_of(tree, view, placement)) {}

void FrustumVisibility::operator()(const VertexTree& tree, std::span<const NodeId> nodes,
                                   std::span<Visibility> seen) const {
    const auto bounds = tree.bounds();
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        const Sphere& sphere = bounds[nodes[i]].ring;
        Visibility result = Visibility::wholly_in;
        for (const Plane& plane : frustum_.planes) {
            const double height = glm::dot(plane.normal, glm::dvec3(sphere.centre)) + plane.offset;
            if (height < -sphere.radius) {
                result = Visibility::out;
                break;
            }
            if (!(height > sphere.radius)) result = Visibility::partly;
        }
        seen[i] = result;
    }
}

} // namespace unseen::vdtree
