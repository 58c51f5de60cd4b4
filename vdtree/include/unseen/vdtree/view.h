// Placements of trees in the world, and views of it.
#pragma once

#include <array>
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
    int width = 1024;          // pixels, which are square
    int height = 1024;
    // Offset of the window's middle from the line of sight, in halves of the window, right and up. Not 0 for one eye of a
    // headset, or for a wall seen at an angle. The field of view is that of the centred window.
    glm::dvec2 shift = {0, 0};
    // World units; not 0: of a stereo pair, midway between both eyes, which look the same way. The shift is the left eye's,
    // and the right one's is mirrored; so is a place in the window the left eye's. Cuts are made for both eyes at once,
    // and pictures are of one: see eyes_of().
    double eye_distance = 0;
    // Makes the view orthographic: world units from the window's bottom to its top, in place of the field of view.
    std::optional<double> orthographic_height = {};

    bool operator==(const View&) const = default;
};

// The view of a camera given as OpenGL matrices: column vectors, the camera looking along -z with y up, clip coordinates
// from -w to w. `view_from_world` is a rotation and a translation; `clip_from_view` is an orthographic or a perspective
// projection, also off centre. Near and far planes are ignored: depth may be reversed, of either range, or infinite.
// Fails, with advice, if a matrix is not finite, singular, mirrored (such as those that flip y for Vulkan), scaled or
// sheared, if the projection is invalid or looks along +z, and if pixels are not square.
Result<View> view_from_matrices(const glm::dmat4& view_from_world, const glm::dmat4& clip_from_view, int width,
                                int height);

// Values must be finite, the eye apart from the target, `up` not along the line of sight, the field in (0, 180), the window
// 1 to 32768 pixels a side, and the view not both orthographic and shifted, or of two eyes.
Result<void> validate(const View& view);
// The same, and the view must be of one eye, or in perspective besides. `what` is the subject of the error's sentence, such
// as "A depth picture".
Result<void> validate_one_eye(const View& view, const char* what);
Result<void> validate_perspective(const View& view, const char* what);

// The left and the right view of a stereo pair; of a view with one eye, twice the same.
std::array<View, 2> eyes_of(const View& view);

// The point of the window on the line of sight, in pixels from the top left.
glm::dvec2 axis_px(const View& view);

// The camera's orthonormal frame in the world, and the window of a perspective view on the plane at distance 1 before the
// eye, right and up from the line of sight.
struct CameraFrame {
    glm::dvec3 right, up, back;     // back: from the target to the eye
    glm::dvec2 window, half_window; // its middle; half of its width and height
};
CameraFrame camera_frame(const View& view);
// Vectors of any length at right angles to the window's sides, pointing inward: left, right, bottom, top. In perspective
// the direction of the view comes first.
std::vector<glm::dvec3> inward_of_window(const View& view);

// A view of a sphere's centre from `direction` (towards the eye), in which its outline takes the share `fill` of the
// window's height: distance = radius / sin(atan(fill tan(fov / 2))). Field and size come from `window`; an orthographic
// height becomes 2 radius / fill.
View frame_sphere(glm::dvec3 centre, double radius, glm::dvec3 direction, double fill, const View& window);

// The view with its eye turned around the axis through the target along `up`, counterclockwise as seen from above.
View orbited(const View& view, double degrees);

} // namespace unseen::vdtree
