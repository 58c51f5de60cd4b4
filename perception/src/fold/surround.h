// What a mesh is seen before, as far as it darkens what bands of low frequencies adapt to.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include <glm/geometric.hpp>

#include <unseen/perception/criterion.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::perception {

struct Surround {
    double darkest_cdm2 = 0;
    double coverage = 1; // share of its sphere's disc that the mesh covers, from all sides in the mean

    // The mean light of a neighbourhood of which the mesh, of this luminance, covers the coverage times so much.
    double mean_cdm2(double luminance_cdm2, double share) const {
        if (!(darkest_cdm2 < luminance_cdm2)) return luminance_cdm2;
        return std::lerp(darkest_cdm2, luminance_cdm2, std::min(1.0, coverage * share));
    }
};

// A quarter of a convex surface's area is what it covers. Cost: one pass over the triangles.
inline Surround surround_of(const vdtree::SoundTree& tree, const FoldTestOptions& options) {
    const vdtree::NodeId leaves = tree.interior_count();
    double area = 0;
    for (const vdtree::Triangle& triangle : tree.triangles()) {
        const auto at = [&](std::size_t k) { return glm::dvec3(tree.positions()[leaves + triangle[k]]); };
        area += 0.5 * glm::length(glm::cross(at(1) - at(0), at(2) - at(0)));
    }
    const double radius = static_cast<double>(tree.bounding_sphere().radius), disc = std::numbers::pi * radius * radius;
    const float darkest = options.scene.behind ? options.scene.behind->lo : options.scene.darkest;
    return {to_luminance(options.display, static_cast<double>(darkest)).value(),
            disc > 0 ? std::min(1.0, area / 4 / disc) : 1};
}

} // namespace unseen::perception
