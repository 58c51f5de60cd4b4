// Where a tree stands in the world and where it is looked at from.
#pragma once

#include <optional>

#include <glm/gtc/quaternion.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <unseen/vdtree/result.h>

namespace unseen::vdtree {

// A similarity transform from mesh units to world units (metres): world = scale * (rotation * p) + translation.
struct Similarity {
    double scale = 1; // world units per mesh unit; positive and finite
    glm::dquat rotation = glm::dquat(1, 0, 0, 0);
    glm::dvec3 translation = glm::dvec3(0);

    glm::dvec3 to_world(glm::dvec3 p) const { return scale * (rotation * p) + translation; }
    glm::dvec3 to_mesh(glm::dvec3 p) const { return glm::inverse(rotation) * ((p - translation) / scale); }
    glm::dvec3 direction_to_mesh(glm::dvec3 v) const { return glm::inverse(rotation) * v; }
};

// A pinhole camera over a window. Lengths in world units, y up in the camera, pixels from the top left.
struct View {
    glm::dvec3 eye = {0, 0, 1};
    glm::dvec3 target = {0, 0, 0};
    glm::dvec3 up = {0, 1, 0};
    double fov_y_degrees = 30; // vertical field of view of the window, in (0, 180)
    int width = 1024;          // pixels, as high as wide
    int height = 1024;         // pixels
    // Where the window's middle lies beside the line of sight, in halves of the window, right and up: not 0 for one eye
    // of a headset, or for a wall that is looked at aslant. The field is what the window would have if it were centred.
    glm::dvec2 shift = {0, 0};
    // Of an orthographic view: the world units from the window's bottom to its top, in place of the field. Things then
    // are of one size wherever they are along the line of sight.
    std::optional<double> orthographic_height = {};

    bool operator==(const View&) const = default;
};

// The view of a camera that is given as matrices in OpenGL's way: column vectors, the camera looking along -z with y up,
// clip coordinates from -w to w. `view_from_world` is a rotation and a translation; `clip_from_view` is a perspective,
// also off centre, or an orthographic projection. Its near and far planes count for nothing: depth may be reversed, of
// either range, or infinite. Fails, and says what to do, where a matrix is not finite, singular, mirrored (as those that
// turn y for Vulkan), scaled or sheared, where the projection is none or looks along +z, and where pixels are not square.
Result<View> view_from_matrices(const glm::dmat4& view_from_world, const glm::dmat4& clip_from_view, int width,
                                int height);

// Finite, eye apart from target, up not along the line of sight, field in (0, 180), a window of at least one
// pixel and at most 32768 a side, and not both orthographic and shifted.
Result<void> validate(const View& view);
// The same for what knows only perspective views, and only those with the line of sight through the window's middle.
// `what` needs such a view, as in "An occlusion map".
Result<void> validate_perspective(const View& view, const char* what);
Result<void> validate_centred(const View& view, const char* what);

// The window of a perspective view on the plane at distance 1 before the eye, right and up from the line of sight.
struct WindowPlane {
    glm::dvec2 middle, half; // half: half of the window's width and height
};
WindowPlane window_plane(const View& view);
// Where the line of sight meets the window, in pixels from its top left.
glm::dvec2 axis_px(const View& view);

// The camera's orthonormal frame in the world. `back` points from the target to the eye.
struct CameraFrame {
    glm::dvec3 right, up, back;
};
CameraFrame camera_frame(const View& view);

// A view from `direction` (towards the eye) in which a sphere's outline takes the share `fill` of the window's
// height: distance = radius / sin(atan(fill tan(fov / 2))). Field and size come from `window`, but for an orthographic
// one, whose height becomes 2 radius / fill; target: the centre.
View frame_sphere(glm::dvec3 centre, double radius, glm::dvec3 direction, double fill, const View& window);

// The view with its eye turned around the axis through the target along `up`, counterclockwise as seen from above.
View orbited(const View& view, double degrees);

} // namespace unseen::vdtree
