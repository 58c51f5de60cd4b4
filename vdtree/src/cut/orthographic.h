// How orthographic views are taken: as those of eyes far away.
#pragma once

#include <algorithm>

#include <glm/geometric.hpp>

#include <unseen/vdtree/vertex_tree.h>
#include <unseen/vdtree/view.h>

namespace unseen::vdtree {

// Distance from the tree's far side to the eye that replaces the view, in heights of the window. A larger one makes sizes
// more alike over the tree's depth and the spread's share of them smaller: both keep a thousandth more of a tree that
// fills the window. A smaller one leaves floats more digits at the window's edge.
inline constexpr double orthographic_distance = 2000;

// Around all that a tree shows in any cut; its own frame.
struct WholeSphere {
    glm::dvec3 centre;
    double radius;
};
inline WholeSphere whole_sphere(const VertexTree& tree) {
    const Sphere leaves = tree.bounding_sphere();
    WholeSphere all{glm::dvec3(leaves.centre), leaves.radius};
    if (tree.interior_count() == 0) return all;
    for (const Sphere& root : {tree.bounds()[VertexTree::root()].ring, tree.support_spheres()[VertexTree::root()]})
        all.radius =
            std::max(all.radius, glm::length(glm::dvec3(root.centre) - all.centre) + static_cast<double>(root.radius));
    return all;
}

} // namespace unseen::vdtree
