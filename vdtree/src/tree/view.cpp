#include <unseen/vdtree/view.h>

#include <numbers>

#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/vectors.h>

namespace unseen::vdtree {

namespace {

// The least sine of the angle between `up` and the line of sight: below it the picture's roll is rounding noise.
constexpr double least_up_sine = 1e-6;
constexpr int largest_window_px = 32768;
// The farthest that a window's middle may lie beside the line of sight, in halves of the window.
constexpr double largest_shift = 1e3;

// How far entries of a client's matrices, which mostly were floats, may be off: shares of the largest.
constexpr double matrix_rounding = 1e-4;
// Pixels count as square if their sides differ by less than this share; floats are a hundred times more exact.
constexpr double pixel_rounding = 1e-5;
// Below this share of the largest entry, one that must not be 0 is.
constexpr double least_share = 1e-12;

bool has_finite_entries(const glm::dmat4& matrix) {
    return std::all_of(&matrix[0][0], &matrix[0][0] + 16, [](double entry) { return std::isfinite(entry); });
}

Result<void> check_view_matrix(const glm::dmat4& m) {
    if (!has_finite_entries(m)) return invalid_argument("The view matrix must be finite.");
    const glm::dmat3 turn(m);
    if (std::abs(m[0][3]) > matrix_rounding || std::abs(m[1][3]) > matrix_rounding ||
        std::abs(m[2][3]) > matrix_rounding || std::abs(m[3][3] - 1) > matrix_rounding)
        return invalid_argument(
            "The last row of the view matrix must be 0 0 0 1: is it the projection, or transposed?");
    if (!(std::abs(glm::determinant(turn)) > least_share))
        return invalid_argument(
            "The view matrix is singular; give one that turns and moves the world before the camera.");
    const glm::dmat3 product = glm::transpose(turn) * turn;
    for (int column = 0; column < 3; ++column)
        for (int row = 0; row < 3; ++row)
            if (!(std::abs(product[column][row] - (row == column ? 1 : 0)) <= matrix_rounding))
                return invalid_argument("The view matrix must only turn and move: it scales or shears. Put a model's "
                                        "scale into its placement.");
    if (glm::determinant(turn) < 0)
        return invalid_argument(
            "The view matrix mirrors the world; cameras of a left-handed world need a mirrored mesh.");
    return {};
}

// What the projection does to x and y; of z only that it is not lost.
Result<void> check_projection(const glm::dmat4& m, double largest) {
    const auto is_none = [&](double entry, double of) { return std::abs(entry) <= matrix_rounding * of; };
    const bool is_perspective = !is_none(m[2][3], largest);
    if (!(largest > 0) || (is_perspective ? std::abs(m[3][2]) : std::abs(m[2][2] * m[3][3])) == 0 ||
        !(std::abs(m[0][0]) > least_share * largest) || !(std::abs(m[1][1]) > least_share * largest))
        return invalid_argument("The projection matrix is singular.");
    const double w = is_perspective ? m[2][3] : m[3][3];
    if (!is_none(m[0][3], std::abs(w)) || !is_none(m[1][3], std::abs(w)) ||
        (is_perspective && !is_none(m[3][3], std::abs(w))))
        return invalid_argument(
            "The last row of the projection matrix must be 0 0 -1 0, or 0 0 0 1 if it is orthographic: "
            "is it transposed, or does it hold the view, too?");
    if (is_perspective && w > 0)
        return invalid_argument("The projection matrix looks along +z; give one of a camera that looks along -z.");
    if (!is_none(m[1][0], std::abs(m[0][0])) || !is_none(m[0][1], std::abs(m[1][1])) ||
        (is_perspective ? !is_none(m[3][0], std::abs(m[0][0])) || !is_none(m[3][1], std::abs(m[1][1]))
                        : !is_none(m[2][0], std::abs(m[0][0])) || !is_none(m[2][1], std::abs(m[1][1]))))
        return invalid_argument("The projection matrix turns or shears the picture; give the camera's own projection, "
                                "and turns in the view matrix.");
    return {};
}

} // namespace

Result<View> view_from_matrices(const glm::dmat4& view_from_world, const glm::dmat4& clip_from_view, int width,
                                int height) {
    if (const auto valid = check_view_matrix(view_from_world); !valid) return valid.error();
    glm::dmat4 clip = clip_from_view;
    if (!has_finite_entries(clip)) return invalid_argument("The projection matrix must be finite.");
    const bool is_perspective = std::abs(clip[2][3]) > std::abs(clip[3][3]);
    const double w = std::abs(is_perspective ? clip[2][3] : clip[3][3]);
    if (!(w > 0)) return invalid_argument("The projection matrix is singular.");
    double largest = 0;
    for (int column = 0; column < 4; ++column)
        for (const int row : {0, 1, 3}) largest = std::max(largest, std::abs(clip[column][row]));
    if (const auto valid = check_projection(clip, largest); !valid) return valid.error();
    clip = clip * (1 / (is_perspective ? w : clip[3][3]));
    if (!(clip[0][0] > 0 && clip[1][1] > 0))
        return invalid_argument("The projection matrix mirrors the picture. Where it turns y, as for Vulkan, give the "
                                "matrix with its second row negated.");

    View view;
    view.width = width, view.height = height;
    const glm::dvec2 half = {1 / clip[0][0], 1 / clip[1][1]}; // of the window: at distance 1, or in world units
    if (!(std::abs(half.x * height / (half.y * width) - 1) <= pixel_rounding))
        return invalid_argument("The pixels of a window of " + std::to_string(width) + "x" + std::to_string(height) +
                                " would not be square under this projection, whose width is " +
                                std::to_string(half.x / half.y) + " of its height; give the window's own size.");
    const glm::dmat3 camera = glm::transpose(glm::dmat3(view_from_world)); // its columns: right, up, back
    view.eye = -(camera * glm::dvec3(view_from_world[3]));
    if (is_perspective) {
        view.fov_y_degrees = 2 * std::atan(half.y) * 180 / std::numbers::pi;
        view.shift = {clip[2][0], clip[2][1]};
    } else {
        view.orthographic_height = 2 * half.y;
        view.eye -= camera[0] * (half.x * clip[3][0]) + camera[1] * (half.y * clip[3][1]);
    }
    // As far away as it is from the origin, so that the direction keeps its digits.
    const double away = std::max(1.0, glm::length(view.eye));
    view.target = view.eye - unit(camera[2]) * away;
    view.up = unit(camera[1]);
    if (const auto valid = validate(view); !valid) return valid.error();
    return view;
}

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
    if (!(std::abs(view.shift.x) <= largest_shift && std::abs(view.shift.y) <= largest_shift))
        return invalid_argument("The window's middle must lie within 1000 halves of it beside the line of sight.");
    if (view.orthographic_height) {
        if (!(*view.orthographic_height > 0) || !std::isfinite(*view.orthographic_height))
            return invalid_argument("The height of an orthographic view must be above 0 and finite.");
        if (view.shift != glm::dvec2(0))
            return invalid_argument("An orthographic view has no shift; move its eye and target instead.");
        if (view.eye_distance != 0) return invalid_argument("An orthographic view has no two eyes.");
    }
    if (!(view.eye_distance >= 0) || !std::isfinite(view.eye_distance))
        return invalid_argument("The distance of a pair of eyes must be 0 or more and finite.");
    if (view.width < 1 || view.height < 1 || view.width > largest_window_px || view.height > largest_window_px)
        return invalid_argument("The window must have 1 to " + std::to_string(largest_window_px) +
                                " pixels a side, not " + std::to_string(view.width) + "x" +
                                std::to_string(view.height) + ".");
    return {};
}

Result<void> validate_one_eye(const View& view, const char* what) {
    if (view.eye_distance != 0)
        return invalid_argument(std::string(what) + " is of one eye, and this view is a stereo pair's.");
    return validate(view);
}

Result<void> validate_perspective(const View& view, const char* what) {
    if (view.orthographic_height)
        return invalid_argument(std::string(what) + " needs a perspective view, and this one is orthographic.");
    return validate_one_eye(view, what);
}

std::array<View, 2> eyes_of(const View& view) {
    View left = view, right = view;
    left.eye_distance = right.eye_distance = 0;
    if (view.eye_distance == 0) return {left, right};
    const glm::dvec3 to_right = camera_frame(view).right * (view.eye_distance / 2);
    left.eye -= to_right, left.target -= to_right;
    right.eye += to_right, right.target += to_right;
    right.shift.x = -view.shift.x;
    return {left, right};
}

glm::dvec2 axis_px(const View& view) {
    return {0.5 * view.width * (1 - view.shift.x), 0.5 * view.height * (1 + view.shift.y)};
}

CameraFrame camera_frame(const View& view) {
    const glm::dvec3 back = unit(view.eye - view.target);
    const glm::dvec3 right = unit(glm::cross(unit(view.up), back));
    const double half_up = std::tan(view.fov_y_degrees * std::numbers::pi / 360);
    const glm::dvec2 half(half_up * view.width / view.height, half_up);
    return {right, glm::cross(back, right), back, view.shift * half, half};
}

std::vector<glm::dvec3> inward_of_window(const View& view) {
    const auto [right, up, back, middle, half] = camera_frame(view);
    if (view.orthographic_height) return {right, -right, up, -up};
    const glm::dvec2 low = half - middle, high = half + middle; // left and down; right and up
    return {-back, right - low.x * back, -right - high.x * back, up - low.y * back, -up - high.y * back};
}

View frame_sphere(glm::dvec3 centre, double radius, glm::dvec3 direction, double fill, const View& window) {
    View view = window;
    if (view.orthographic_height) view.orthographic_height = 2 * radius / fill;
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
