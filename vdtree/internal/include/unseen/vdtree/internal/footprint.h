// What points cover of a window.
#pragma once

#include <unseen/vdtree/view.h>

namespace unseen::vdtree {

// The part of the window that some points cover, and the nearest of them. The footprint of several points contains that of
// every point between them.
struct Footprint {
    double left = 1e300, top = 1e300, right = -1e300, bottom = -1e300; // pixels
    double nearest = 1e300; // along the view's axis, world units; 0 or less beside and behind the eye

    void add(const Footprint& other) noexcept;
};

// Projects points of the world onto a view's window.
class Projector {
public:
    explicit Projector(const View& view); // precondition: valid, and perspective
    Footprint operator()(glm::dvec3 point) const noexcept;

private:
    glm::dvec3 eye_;
    CameraFrame camera_;
    glm::dvec2 axis_px_;
    double focal_px_; // tangents in pixels
};

} // namespace unseen::vdtree
