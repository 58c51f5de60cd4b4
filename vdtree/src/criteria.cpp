#include <vdtree/criteria.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace unseen::vdtree {

namespace {

double distance_to(const Sphere& sphere, glm::dvec3 eye) { return glm::length(glm::dvec3(sphere.centre) - eye); }

} // namespace

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

ExtentCriterion::ExtentCriterion(const VertexTree& tree, const View& view, double tolerance_pixels,
                                 const Similarity& placement)
    : eye_(eye_in_tree(tree, view, placement)), scale_(pixels_per_radian(view) / tolerance_pixels) {}

void ExtentCriterion::operator()(const VertexTree& tree, std::span<const NodeId> nodes, std::span<float> costs) const {
    const auto spheres = tree.support_spheres();
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        const Sphere& sphere = spheres[nodes[i]];
        const double distance = distance_to(sphere, eye_);
        costs[i] = distance > sphere.radius ? static_cast<float>(2 * std::asin(sphere.radius / distance) * scale_)
                                            : unbounded_cost(0);
    }
}

DisplacementCriterion::DisplacementCriterion(const VertexTree& tree, const View& view, double tolerance_pixels,
                                             const Similarity& placement)
    : eye_(eye_in_tree(tree, view, placement)), scale_(pixels_per_radian(view) / tolerance_pixels) {}

void DisplacementCriterion::operator()(const VertexTree& tree, std::span<const NodeId> nodes,
                                       std::span<float> costs) const {
    const auto spheres = tree.support_spheres();
    const auto displacement = tree.displacement();
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        const NodeId node = nodes[i];
        const double nearest = distance_to(spheres[node], eye_) - spheres[node].radius;
        if (displacement[node] == 0) costs[i] = 0;
        // Two points that are at least so far away and at most so far apart are seen under this angle at most.
        else if (nearest > 0)
            costs[i] = static_cast<float>(2 * std::asin(std::min(1.0, displacement[node] / (2 * nearest))) * scale_);
        else costs[i] = unbounded_cost(0);
    }
}

} // namespace unseen::vdtree
