#include <unseen/vdtree/view.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "tree/unit_vector.h"
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/finite.h>

namespace unseen::vdtree {

namespace {

// The least sine of the angle between `up` and the line of sight: below it the picture's roll is rounding noise.
constexpr double least_up_sine = 1e-6;
constexpr int largest_window_px = 32768;

} // namespace

Result<void> validate(const View& view) {
    if (!is_finite(view.eye) || !is_finite(view.target) || !is_finite(view.up))
        return invalid_argument("The view's eye, target and up must be finite.");
    if (view.eye == view.target)
        return invalid_argument("The view's eye and target are the same point; move one of them.");
    const glm::dvec3 back = unit(view.eye - view.target), up = unit(view.up);
    if (!(glm::length(glm::cross(back, up)) > least_up_sine))
        return invalid_argument("The view's up vector lies along the line of sight; choose another.");
    if (!(view.fov_y_degrees > 0 && view.fov_y_degrees < 180))
        return invalid_argument("The field of view must be above 0 and below 180 degrees.");
    if (view.width < 1 || view.height < 1 || view.width > largest_window_px || view.height > largest_window_px)
        return invalid_argument("The window must have 1 to " + std::to_string(largest_window_px) +
                                " pixels a side, not " + std::to_string(view.width) + "x" +
                                std::to_string(view.height) + ".");
    return {};
}

CameraFrame camera_frame(const View& view) {
    const glm::dvec3 back = unit(view.eye - view.target);
    const glm::dvec3 right = unit(glm::cross(unit(view.up), back));
    return {right, glm::cross(back, right), back};
}

View frame_sphere(glm::dvec3 centre, double radius, glm::dvec3 direction, double fill, const View& window) {
    View view = window;
    const double half_field = window.fov_y_degrees * std::numbers::pi / 360;
    const double half_angle = std::atan(fill * std::tan(half_field));
    const glm::dvec3 towards_eye = unit(direction);
    view.target = centre;
    view.eye = centre + towards_eye * (radius / std::sin(half_angle));
    // Looking straight up or down, +Y is no help: take -Z for up, as maps do.
    view.up = std::abs(towards_eye.y) < 0.999 ? glm::dvec3(0, 1, 0) : glm::dvec3(0, 0, -1);
    return view;
}

View orbited(const View& view, double degrees) {
    const glm::dquat turn = glm::angleAxis(degrees * std::numbers::pi / 180, unit(view.up));
    View other = view;
    other.eye = view.target + turn * (view.eye - view.target);
    return other;
}

} // namespace unseen::vdtree
