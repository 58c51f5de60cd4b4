// From the mesh to the screen, computed in double.
#pragma once

#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <unseen/vdtree/vertex_tree.h>
#include <unseen/vdtree/view.h>

namespace unseen::render {

// The unit frame: vertices are uploaded as (p - centre) / unit, so that a mesh of any size and at any place fills about
// the unit ball in float, where no product of coordinates overflows or vanishes. `unit` is a power of two: dividing by
// it changes no mantissa.
struct UnitFrame {
    glm::dvec3 centre = glm::dvec3(0); // relative to the tree's origin, mesh units
    double unit = 1;                   // mesh units per unit of the frame
    double radius = 1;                 // of the ball around all that is drawn, units of the frame; 0.5..1, or 0
};

UnitFrame unit_frame(const vdtree::Sphere& bounds);

// Clip space with reversed depth. In perspective: 1 at the near plane, 0 at infinity. In parallel: 1 at the near plane,
// 0 at the far one.
struct Projection {
    glm::dmat4 clip_from_unit = glm::dmat4(1);
    double world_unit = 1; // world units per unit of the frame
    double near_plane = 1; // distance, world units; in parallel also 0 or below, for the eye may be among the items
    double far_plane = 0;  // likewise; in parallel alone
    // Likewise: z in the camera's frame, of what clip_from_unit takes; units of the frame.
    glm::dvec4 view_z = glm::dvec4(0);
    bool eye_inside = false; // of the ball; in parallel never, for all of it is before the picture

    void set_near_plane(double distance); // of perspective; world units; an object's own changes no bit
    void set_depth_range(double nearest, double farthest); // of parallel ones; world units
};

// With the object's own planes: just before its ball and, in parallel, just behind it. Precondition: valid view and
// placement. The eye is the origin in all that is added up, so that the precision is that of the distance from the eye,
// not of the distance from the world's origin.
Projection projection_of(const vdtree::View& view, const vdtree::Similarity& placement, glm::dvec3 origin,
                         const UnitFrame& frame);

// The projection with the picture moved so that the point `sample` of each pixel, in 0..1 from its top left, comes to
// lie at the pixel's centre.
glm::mat4 jittered(const Projection& projection, const vdtree::View& view, glm::dvec2 sample);

} // namespace unseen::render
