// How densely a texture lies on the surface.
#pragma once

#include <span>
#include <vector>

#include <unseen/vdtree/vertex_tree.h>

#include "measure/textured_light.h"

namespace unseen::perception {

// Texels a mesh unit, along the surface's direction with the fewest and with the most: the squares' means by area.
struct TextureDensity {
    float least = 0, most = 0;
    float mean = 0; // of the texture's luminance there, by area
};

class TextureDensities {
public:
    // Cost: one pass over the triangles.
    TextureDensities(const vdtree::SoundTree& tree, const TextureDetail& texture);

    // Of the mesh's triangles that vanish under a node, and of these others around it.
    TextureDensity of(vdtree::NodeId node, std::span<const vdtree::Index> around) const;

private:
    struct Sum {
        double area = 0, least = 0, most = 0, light = 0; // the others times the area
        Sum& operator+=(const Sum& other) {
            area += other.area, least += other.least, most += other.most, light += other.light;
            return *this;
        }
    };
    Sum between(vdtree::Index first, vdtree::Index end) const; // triangles

    std::vector<Sum> before_triangle_;
    std::span<const vdtree::NodeId> subtree_end_;
    std::span<const vdtree::Index> first_triangle_;
};

} // namespace unseen::perception
