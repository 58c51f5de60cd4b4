// What a node's ring shows of the texture, in any state of the ring.
#pragma once

#include <unseen/vdtree/internal/texture_pyramid.h>
#include <unseen/vdtree/internal/tree_parts.h>
#include <unseen/vdtree/internal/vertex_tree_data.h>

namespace unseen::vdtree {

// By wedge of an interior node: the box of the texture coordinates of all corners of the triangles around its leaves, and
// of the proxies below. All that triangles around the node show there, unfolded or folded, in whatever part, lies within
// it. Cost: one pass over triangles and nodes; parallel. Likewise the next.
std::vector<UvBox> bound_footprints(const TreeGeometry& geometry, const TreeParts& parts);

// By interior node: the texture's luminance over the footprints of its wedges. Grows up the tree.
std::vector<PackedRange> bound_ring_texture(const TreeGeometry& geometry, const TreeParts& parts);
std::vector<PackedRange> bound_ring_emission(const TreeGeometry& geometry, const TreeParts& parts); // there must be one

// The range of luminances multiplied by a texture, rounded outward.
PackedRange product(PackedRange luminance, PackedRange texture);
PackedRange sum(PackedRange a, PackedRange b); // cut off at white

// The least and the largest channel of a vertex's colour as it is drawn, scaled to its luminance: a texture of the
// luminance T comes out between these times T. Rounded outward.
PackedRange channel_range(const glm::vec4& colour, Unorm16 luminance);

} // namespace unseen::vdtree
