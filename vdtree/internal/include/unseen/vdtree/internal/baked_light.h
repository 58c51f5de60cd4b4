// Finds out whether light is baked into a tree's colours, as in photographs and in renderers' output. Only a hint: paint may
// follow the normals, too, as snow does.
#pragma once

#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

struct BakedLight {
    glm::vec3 direction = glm::vec3(0); // towards the light, unit; zero if no light explains anything
    double explained = 0;               // share of the variance of the colours' luminance, 0..1
};

// Above this share one light explains more of the colours than everything else together: half of the variance.
inline constexpr double telling_share = 0.5;

// The light for which a + b max(0, n.direction), b > 0, best fits the luminance of the colours times the texture at the
// input's vertices (least squares). The share is R^2, adjusted for the number of different normals (Theil 1961), because a
// few normals are soon fitted by chance. It is 0 without colours and texture, and if they hardly differ. Fails if
// VertexTree::check() fails. Cost: some milliseconds; it reads at most 65,536 vertices.
Result<BakedLight> find_baked_light(const VertexTree& tree);

} // namespace unseen::vdtree
