#include <perception/criterion.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <glm/geometric.hpp>

#include "fold_screen.h"

namespace unseen::perception {

namespace {

constexpr std::size_t chunk = 256; // nodes whose gratings are looked up at once

double angle_between(glm::dvec3 a, glm::dvec3 b) { return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b)); }

// A cone of directions from the eye, as the camera sees it: `axis` unit in (right, up, back), half-angle in radians.
struct Cone {
    glm::dvec3 axis;
    double half_angle;
};

// How much an angle within the cone grows when the camera's tangents are scaled by `scale` to those on the screen: the
// largest derivative over the cone. 1 where camera and screen agree. Both bounds grow with the cone, so they keep the
// criterion monotone up the tree. Infinite where the cone reaches the camera's plane.
double screen_magnification(const Cone& cone, double scale) {
    if (scale == 1) return 1;
    const double off_axis = angle_between(cone.axis, {0, 0, -1});
    if (scale > 1) {
        // Largest nearest the axis, across the radius: sin(a') / sin(a).
        const double t = std::tan(std::min(std::max(0.0, off_axis - cone.half_angle), 1.57));
        return scale * std::sqrt((1 + t * t) / (1 + scale * scale * t * t));
    }
    // Largest farthest from the axis, along the radius: da' / da.
    const double outermost = off_axis + cone.half_angle;
    if (!(outermost < std::numbers::pi / 2)) return std::numeric_limits<double>::infinity();
    const double t = std::tan(outermost);
    return scale * (1 + t * t) / (1 + scale * scale * t * t);
}

// The direction on the screen, seen by the viewer, of a direction in the camera's frame that points away from the camera.
glm::dvec3 on_screen(glm::dvec3 direction, double scale) {
    return glm::normalize(glm::dvec3(direction.x * scale, direction.y * scale, direction.z));
}

} // namespace

LuebkeHallenCriterion::LuebkeHallenCriterion(const vdtree::VertexTree& tree, const vdtree::View& view,
                                             const FoldTestOptions& options, const vdtree::Similarity& placement)
    : csf_(options.csf), eye_(vdtree::eye_in_tree(tree, view, placement)),
      scene_(options.scene) {
    const vdtree::CameraFrame frame = vdtree::camera_frame(view);
    right_ = placement.direction_to_mesh(frame.right);
    up_ = placement.direction_to_mesh(frame.up);
    back_ = placement.direction_to_mesh(frame.back);

    const Screen screen(view, options);
    screen_scale_ = screen.scale;
    pixel_deg_ = screen.pixel_deg;
    black_ = black_level(options.display).value();
    span_ = to_luminance(options.display, 1).value() - black_;
    if (options.gaze_px) {
        has_gaze_ = true;
        gaze_ = glm::normalize(glm::dvec3((options.gaze_px->x - view.width * 0.5) * screen.pitch_over_distance,
                                          (view.height * 0.5 - options.gaze_px->y) * screen.pitch_over_distance, -1));
    }
}

void LuebkeHallenCriterion::operator()(const vdtree::VertexTree& tree, std::span<const vdtree::NodeId> nodes,
                                       std::span<float> costs) const {
    const auto bounds = tree.bounds();
    const auto ranges = tree.ring_luminance();
    const auto adaptations = tree.adaptation_luminance();
    std::array<float, chunk> contrast, eccentricity, luminance, log2_frequency, extent;

    for (std::size_t begin = 0; begin < nodes.size(); begin += chunk) {
        const std::size_t count = std::min(chunk, nodes.size() - begin);
        for (std::size_t i = 0; i < count; ++i) {
            const vdtree::NodeId node = nodes[begin + i];
            const vdtree::NodeBounds& around = bounds[node];
            const vdtree::Sphere& sphere = around.ring;
            const glm::dvec3 to_centre = glm::dvec3(sphere.centre) - eye_;
            const double distance = glm::length(to_centre), radius = sphere.radius;
            const bool outside = distance > radius;

            const glm::dvec3 direction = outside ? to_centre / distance : -back_;
            const Cone cone = {{glm::dot(direction, right_), glm::dot(direction, up_), glm::dot(direction, back_)},
                               outside ? std::asin(radius / distance) : std::numbers::pi};
            const double magnification = outside ? screen_magnification(cone, screen_scale_) : 1;
            const double extent_deg = 2 * cone.half_angle * magnification * degrees_per_radian;
            extent[i] = static_cast<float>(outside ? std::max(extent_deg, pixel_deg_)
                                                   : std::numeric_limits<double>::infinity());

            double eccentricity_deg = 0;
            if (has_gaze_ && outside && std::isfinite(magnification) && (screen_scale_ == 1 || cone.axis.z < 0)) {
                const double angle = angle_between(on_screen(cone.axis, screen_scale_), gaze_);
                eccentricity_deg = std::max(0.0, angle - cone.half_angle * magnification) * degrees_per_radian;
            }
            eccentricity[i] = static_cast<float>(eccentricity_deg);

            // Silhouettes may uncover anything in the scene, and so may what is translucent.
            const bool silhouette =
                (around.flags & (vdtree::irregular_ring | vdtree::translucent_ring)) ||
                vdtree::facing(around.slabs, [&] { return tree.mask(node); }, glm::vec3(-direction),
                               static_cast<float>(distance), sphere.radius) == vdtree::Facing::mixed;
            vdtree::LuminanceRange range = ranges[node];
            float adaptation = adaptations[node];
            if (silhouette) {
                range = {std::min(range.lo, scene_.darkest), std::max(range.hi, scene_.brightest)};
                adaptation = std::max(adaptation, 0.5f * (range.lo + range.hi));
            }
            const double lo = black_ + span_ * range.lo, hi = black_ + span_ * range.hi;
            contrast[i] = static_cast<float>((hi - lo) / (hi + lo));
            luminance[i] = static_cast<float>(black_ + span_ * adaptation);
        }
        csf().highest_visible_log2_frequency(std::span(contrast).first(count), std::span(eccentricity).first(count),
                                             std::span(luminance).first(count), std::span(log2_frequency).first(count));
        for (std::size_t i = 0; i < count; ++i) {
            const float frequency = std::exp2(log2_frequency[i]); // 0 where nothing can be seen
            if (!(contrast[i] > 0)) costs[begin + i] = 0;
            else if (std::isinf(extent[i])) costs[begin + i] = vdtree::unbounded_cost(contrast[i]);
            else costs[begin + i] = 2 * extent[i] * frequency;
        }
    }
}

} // namespace unseen::perception
