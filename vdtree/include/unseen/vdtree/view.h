// Where a tree stands in the world and where it is looked at from.
#pragma once

#include <glm/gtc/quaternion.hpp>
#include <glm/mat4x4.hpp>
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
    int width = 1024;          // pixels
    int height = 1024;         // pixels
};

// Finite, eye apart from target, up not along the line of sight, field in (0, 180), a window of at least one
// pixel and at most 32768 a side.
Result<void> validate(const View& view);

// The camera's orthonormal frame in the world. `back` points from the target to the eye.
struct CameraFrame {
    glm::dvec3 right, up, back;
};
CameraFrame camera_frame(const View& view);

// A view from `direction` (towards the eye) in which a sphere's outline takes the share `fill` of the window's
// height: distance = radius / sin(atan(fill tan(fov / 2))). Field and size come from `window`; target: the centre.
View frame_sphere(glm::dvec3 centre, double radius, glm::dvec3 direction, double fill, const View& window);

// The view with its eye turned around the axis through the target along `up`, counterclockwise as seen from above.
View orbited(const View& view, double degrees);

} // namespace unseen::vdtree
