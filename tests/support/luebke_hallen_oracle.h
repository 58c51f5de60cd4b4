// The fold test of Luebke and Hallen 2001, section 3.3, node by node and without any classes, tables of reaches or
// bins: what the criterion in distance form is held to. For views whose field is the display's own.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <glm/geometric.hpp>

#include <unseen/perception/criterion.h>
#include <unseen/perception/csf.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/internal/normal_mask.h>

namespace unseen::support {

// 2 theta' rho*, by interior node: imperceptible up to 1; infinite with the eye inside the ring's sphere. `viewpoint`:
// of the view.
inline std::vector<float> luebke_hallen_costs(const vdtree::VertexTree& tree, const vdtree::Viewpoint& viewpoint,
                                              const perception::FoldTestOptions& options) {
    using namespace perception;
    constexpr double degrees = 180 / std::numbers::pi;                          // in a radian
    const CsfTable& csf = options.csf ? *options.csf : *csf_of(default_person); // which is kept
    const double pixel_deg = 1 / coarsest_pixels_per_degree(options.display).value();
    const std::size_t count = tree.interior_count();
    std::vector<float> contrast(count), eccentricity(count), luminance(count), log2_frequency(count), extent_deg(count);
    for (vdtree::NodeId node = 0; node < count; ++node) {
        const vdtree::NodeBounds& around = tree.bounds()[node];
        const glm::dvec3 to_centre = glm::dvec3(around.ring.centre) - viewpoint.eye;
        const double distance = glm::length(to_centre), radius = around.ring.radius;
        const bool is_outside = distance > radius;
        const glm::dvec3 direction = to_centre / distance;
        const double half_angle = is_outside ? std::asin(radius / distance) : std::numbers::pi;
        extent_deg[node] = is_outside ? static_cast<float>(std::max(2 * half_angle * degrees, pixel_deg))
                                      : std::numeric_limits<float>::infinity();
        if (viewpoint.gaze && is_outside) {
            const double angle =
                std::atan2(glm::length(glm::cross(direction, *viewpoint.gaze)), glm::dot(direction, *viewpoint.gaze));
            eccentricity[node] = static_cast<float>(std::max(0.0, angle - half_angle) * degrees);
        }
        vdtree::LuminanceRange range = tree.ring_luminance()[node];
        float adaptation = tree.adaptation_luminance()[node];
        const bool is_silhouette =
            (around.flags & (vdtree::irregular_ring | vdtree::translucent_ring)) ||
            vdtree::facing(around.slabs, tree.mask(node), glm::vec3(-direction), static_cast<float>(distance),
                           around.ring.radius) == vdtree::Facing::mixed;
        if (is_silhouette) {
            range = {std::min(range.lo, options.scene.darkest), std::max(range.hi, options.scene.brightest)};
            adaptation = std::max(adaptation, 0.5f * (range.lo + range.hi));
        }
        const double lo = to_luminance(options.display, static_cast<double>(range.lo)).value(),
                     hi = to_luminance(options.display, static_cast<double>(range.hi)).value();
        contrast[node] = static_cast<float>((hi - lo) / (hi + lo));
        luminance[node] = static_cast<float>(to_luminance(options.display, static_cast<double>(adaptation)).value());
    }
    csf.highest_visible_log2_frequency(contrast, eccentricity, luminance, log2_frequency);
    std::vector<float> costs(count);
    for (std::size_t node = 0; node < count; ++node)
        costs[node] = contrast[node] > 0 ? 2 * extent_deg[node] * std::exp2(log2_frequency[node]) : 0;
    return costs;
}

// A callback that gives the costs of a list.
class ListedCosts {
public:
    explicit ListedCosts(std::vector<float> costs) : costs_(std::move(costs)) {}
    void operator()(const vdtree::VertexTree&, std::span<const vdtree::NodeId> nodes, std::span<float> costs) const {
        for (std::size_t i = 0; i < nodes.size(); ++i) costs[i] = costs_[nodes[i]];
    }

private:
    std::vector<float> costs_;
};

} // namespace unseen::support
