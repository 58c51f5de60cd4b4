// What the texels of a tree's texture show in the light of its vertices: their colours, brightened by a normal map, with
// the light that they send out themselves.
#pragma once

#include <unseen/vdtree/vertex_tree.h>

namespace unseen::perception {

// Refers to the tree. Pixels are drawn as this times their vertices' luminance. What a normal map brightens and what
// emission adds depends on where a texel lies: it is the mean over the triangles that show it, in the light that the
// tree's vertices are lit by. Under other lights that stands for what a normal map does there.
class ShownTexels {
public:
    // The tree must have a texture. Cost: nothing, or with a normal map or emission 16 looks for each texel or triangle
    // at most, of 50 ns, 8 bytes for each texel, and 16 more meanwhile.
    explicit ShownTexels(const vdtree::VertexTree& tree);
    ShownTexels(const vdtree::TextureView& colours) : texture_(colours) {} // alone; valid, and not empty

    const vdtree::TextureView& texture() const { return texture_; }
    bool are_alike() const;                    // all of them
    glm::vec3 colour(std::size_t texel) const; // linear RGB, and more than 1 where it is brightened beyond
    double luminance(std::size_t texel) const;

private:
    void look_at_triangles(const vdtree::VertexTree& tree, bool has_relief);

    struct Place {
        float brightening = 1, shade = 1;
    };
    vdtree::TextureView texture_;
    std::vector<Place> places_; // by texel; empty: none of it matters
};

} // namespace unseen::perception
