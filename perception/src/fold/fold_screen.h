// What fold tests in distance form know of the camera, the display, and what is around and behind a mesh.
#pragma once

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

#include <unseen/perception/criterion.h>
#include <unseen/vdtree/internal/errors.h>

namespace unseen::perception {

inline constexpr double degrees_per_bin = 0.5; // of eccentricity on the screen
inline constexpr std::size_t bin_count = 128;  // up to 64 degrees; beyond, sensitivity is taken as there

// The lowest frequency that counts: far aside coarse patterns are seen best. Below it, meshes fill the field.
inline constexpr double lowest_table_cpd = 1.0 / 16;

// Covers the rounding of a switch distance to float.
inline constexpr double distance_rounding = 1e-6;

// What a pattern of this width covers.
inline SquareDegrees disc(double width_deg) { return SquareDegrees(std::numbers::pi * width_deg * width_deg / 4); }

// The sensitivity that the test goes by.
inline const CsfTable& csf_of(const FoldTestOptions& options) {
    return options.csf ? *options.csf : *csf_of(default_person); // which is kept
}

// What has to hold before a fold test computes with its arguments.
inline Result<void> check_arguments(const vdtree::View& view, const FoldTestOptions& options) {
    if (auto ok = validate(options.display); !ok) return ok;
    if (auto ok = vdtree::validate(view); !ok) return ok;
    // The eye that stands for such a view is so far away that floats do not tell apart where it looks.
    if (options.gaze_px && view.orthographic_height)
        return invalid_argument(
            "fold test: an orthographic view has no gaze; leave it out, and all of the view counts as looked at");
    if (options.gaze_px && !(std::isfinite(options.gaze_px->x) && std::isfinite(options.gaze_px->y)))
        return invalid_argument("fold test: the gaze must be a finite position in pixels");
    const vdtree::LuminanceRange behind = options.scene.behind.value_or(vdtree::LuminanceRange{});
    for (const float relative : {options.scene.darkest, options.scene.brightest, behind.lo, behind.hi})
        if (!std::isfinite(relative)) return invalid_argument("fold test: the scene's luminances must be finite");
    return {};
}

// The camera's and the display's geometry, as far as the test needs it.
struct Screen {
    double scale = 1;       // tangent on the screen over tangent in the camera
    double pixel_deg = 0;   // the largest: what a change fills at least
    double highest_cpd = 0; // of the finest pixels
    double pitch_over_distance = 0;
    double largest_magnification = 1, least_magnification = 1; // of angles, from the camera to the screen

    Screen(const vdtree::View& view, const FoldTestOptions& options) {
        const double tan_physical = std::tan(to_radians(physical_field(options.display, view.height)).value() / 2);
        const double tan_camera = view.orthographic_height ? view.height / (2 * vdtree::pixels_per_radian(view))
                                                           : std::tan(view.fov_y_degrees * std::numbers::pi / 360);
        scale = tan_physical / tan_camera;
        constexpr double same = 1e-9; // the default field is the physical one by way of degrees
        if (std::abs(scale - 1) < same) scale = 1;
        pixel_deg = 1 / coarsest_pixels_per_degree(options.display).value();
        highest_cpd = nyquist(finest_pixels_per_degree(options.display)).value();
        pitch_over_distance = options.display.pixel_pitch.value() / options.display.distance.value();
        // From the axis to the farthest corner of the window, or to the gaze if that is farther. The viewer's eye is
        // before the point of the screen where the line of sight meets it.
        const double aspect = static_cast<double>(view.width) / view.height;
        double farthest = tan_camera * std::hypot(aspect * (1 + std::abs(view.shift.x)), 1 + std::abs(view.shift.y));
        if (options.gaze_px) {
            const glm::dvec2 from_axis = *options.gaze_px - vdtree::axis_px(view);
            farthest = std::max(farthest, std::hypot(from_axis.x, from_axis.y) * pitch_over_distance / scale);
        }
        const double t2 = farthest * farthest;
        const double at_edge =
            scale * (1 + t2) / (1 + scale * scale * t2); // along the radius; across it, its root in between
        largest_magnification = std::max(scale, at_edge);
        least_magnification = std::min(scale, at_edge);
    }
};

struct Surround {
    double darkest_cdm2 = 0;
    double coverage = 1; // share of its sphere's disc that the mesh covers, from all sides in the mean
    // The width of a disc that all of the mesh fills, from wherever it covers most, over the sphere's.
    double compactness = 1;

    // The mean light of a neighbourhood of which the mesh, of this luminance, covers the coverage times so much.
    double mean_cdm2(double luminance_cdm2, double share) const {
        if (!(darkest_cdm2 < luminance_cdm2)) return luminance_cdm2;
        return std::lerp(darkest_cdm2, luminance_cdm2, std::min(1.0, coverage * share));
    }
};

// A quarter of a convex surface's area is what it covers. Cost: one pass over the triangles.
inline Surround surround_of(const vdtree::SoundTree& tree, const FoldTestOptions& options) {
    const vdtree::WedgeId leaves = tree.interior_wedge_count();
    double area = 0;
    for (const vdtree::Triangle& triangle : tree.triangles()) {
        const auto at = [&](std::size_t k) { return glm::dvec3(tree.positions()[leaves + triangle[k]]); };
        area += 0.5 * glm::length(glm::cross(at(1) - at(0), at(2) - at(0)));
    }
    const double radius = static_cast<double>(tree.bounding_sphere().radius), disc = std::numbers::pi * radius * radius;
    const float darkest = options.scene.behind ? options.scene.behind->lo : options.scene.darkest;
    // Half of a closed surface faces away from wherever one looks.
    const double most = tree.closedness() == vdtree::Closedness::open ? area : area / 2;
    return {to_luminance(options.display, static_cast<double>(darkest)).value(),
            disc > 0 ? std::min(1.0, area / 4 / disc) : 1, disc > 0 ? std::sqrt(std::min(1.0, most / disc)) : 1};
}

} // namespace unseen::perception
