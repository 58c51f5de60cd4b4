// The projection: camera-relative, in units of the model's own size, with reversed depth.
#include "camera.h"

#include <algorithm>
#include <cmath>

#include <glm/gtc/matrix_access.hpp>
#include <glm/gtc/matrix_transform.hpp>

namespace unseen::render {
namespace {

// Near plane at least so far, as a share of the ball's radius: with the eye inside of the model, what is nearer is cut
// off. Depth is float and reversed, so a near plane that is too near costs no precision.
constexpr double least_near = 1e-4;

// The ball's bounds and the vertices are rounded to float: the near plane keeps this share away from them.
constexpr double near_margin = 0.5;

// What stands for the radius of a ball of no size (coincident vertices), units of the frame.
constexpr double point_radius = 1e-6;

double near_plane(glm::dvec3 centre_in_view, double radius, glm::dvec2 corner) {
    const double distance = glm::length(centre_in_view);
    const double nearest = distance - radius;
    const double floor = least_near * std::max(radius, point_radius);
    if (!(nearest > 0)) return floor;
    // A point that far away in the corner of the picture has the least depth.
    const double corner_cosine = 1 / std::sqrt(1 + glm::dot(corner, corner));
    const double depth = std::max(-centre_in_view.z - radius, nearest * corner_cosine);
    return std::max(near_margin * depth, floor);
}

// Near and far plane lie so far before and behind the ball, as a share of its radius.
constexpr double parallel_margin = 1e-3;

Projection parallel(const vdtree::View& view, const glm::dmat4& view_from_unit, double world_unit, double radius) {
    Projection projection;
    projection.world_unit = world_unit;
    const double half_height = *view.orthographic_height / 2 / world_unit;
    glm::dmat4 clip_from_view(1);
    clip_from_view[0][0] = view.height / (half_height * view.width);
    clip_from_view[1][1] = 1 / half_height;
    projection.clip_from_unit = clip_from_view * view_from_unit;
    projection.view_z = glm::row(view_from_unit, 2);
    const double reach = (1 + parallel_margin) * std::max(radius, point_radius), middle = -view_from_unit[3].z;
    projection.set_depth_range((middle - reach) * world_unit, (middle + reach) * world_unit);
    return projection;
}

} // namespace

UnitFrame unit_frame(const vdtree::Sphere& bounds) {
    UnitFrame frame;
    frame.centre = glm::dvec3(bounds.centre);
    int exponent = 0;
    const double radius = bounds.radius;
    if (radius > 0 && std::isfinite(radius)) std::frexp(radius, &exponent);
    frame.unit = std::ldexp(1.0, exponent);
    frame.radius = radius / frame.unit;
    return frame;
}

// In perspective, depth is near plane / distance. Only the row of z knows the near plane.
void Projection::set_near_plane(double distance) {
    if (distance == near_plane) return;
    near_plane = distance;
    clip_from_unit[3][2] = distance / world_unit;
}

// In parallel, depth is (far plane - distance) / range. The distance is -z in the camera's frame.
void Projection::set_depth_range(double nearest, double farthest) {
    const double range = farthest - nearest;
    for (int column = 0; column < 4; ++column) clip_from_unit[column][2] = view_z[column] * world_unit / range;
    clip_from_unit[3][2] += farthest / range;
    near_plane = nearest;
    far_plane = farthest;
}

Projection projection_of(const vdtree::View& view, const vdtree::Similarity& placement, glm::dvec3 origin,
                         const UnitFrame& frame) {
    const vdtree::CameraFrame axes = vdtree::camera_frame(view);
    const glm::dmat3 view_from_world = glm::transpose(glm::dmat3(axes.right, axes.up, axes.back));
    const glm::dmat3 rotation = view_from_world * glm::mat3_cast(placement.rotation);
    const double world_unit = placement.scale * frame.unit;
    const glm::dvec3 from_eye = placement.to_world(origin + frame.centre) - view.eye;
    const glm::dvec3 centre_in_view = view_from_world * from_eye / world_unit;

    glm::dmat4 view_from_unit(rotation);
    view_from_unit[3] = glm::dvec4(centre_in_view, 1);

    if (view.orthographic_height) return parallel(view, view_from_unit, world_unit, frame.radius);

    glm::dmat4 clip_from_view(0);
    clip_from_view[0][0] = 1 / axes.half_window.x;
    clip_from_view[1][1] = 1 / axes.half_window.y;
    clip_from_view[2][0] = view.shift.x;
    clip_from_view[2][1] = view.shift.y;
    clip_from_view[2][3] = -1;
    clip_from_view[3][2] = near_plane(centre_in_view, frame.radius, glm::abs(axes.window) + axes.half_window);

    Projection projection;
    projection.clip_from_unit = clip_from_view * view_from_unit;
    projection.world_unit = world_unit;
    projection.near_plane = clip_from_view[3][2] * world_unit;
    projection.eye_inside = !(glm::length(centre_in_view) > frame.radius);
    return projection;
}

glm::mat4 jittered(const Projection& projection, const vdtree::View& view, glm::dvec2 sample) {
    // y points up in clip space and down in the pixel.
    const glm::dvec3 shift(2 * (0.5 - sample.x) / view.width, 2 * (sample.y - 0.5) / view.height, 0);
    return glm::mat4(glm::translate(glm::dmat4(1), shift) * projection.clip_from_unit);
}

} // namespace unseen::render
