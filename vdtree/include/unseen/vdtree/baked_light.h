// Whether light seems to be in a tree's colours already, as in photographs and in what renderers write. A hint: paint
// may follow the normals, too, as snow does.
#pragma once

#include <glm/vec3.hpp>

#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

struct BakedLight {
    glm::vec3 direction = glm::vec3(0); // towards it, unit; zero where no light explains anything
    double explained = 0;               // share of the variance of the colours' luminance, 0..1
};

// Above this share one light explains more of the colours than everything else together: half of the variance.
inline constexpr double telling_share = 0.5;

// The light for which a + b max(0, n.direction), b > 0, comes nearest to the luminance of the colours, times the
// texture's, at the input's vertices (least squares, R^2). A few normals are soon fitted by chance, so the share is R^2
// adjusted for the number of different ones (Theil 1961). It is 0 without colours and texture, and where they hardly
// differ. Fails where VertexTree::check() does. Cost: some milliseconds, for it looks at 65,536 vertices at most.
Result<BakedLight> find_baked_light(const VertexTree& tree);

} // namespace unseen::vdtree
