// The chroma of a tree's nodes and of their rings.
#pragma once

#include <vector>

#include <vdtree/chroma.h>

#include "tree/tree_parts.h"
#include "tree/vertex_tree_data.h"

namespace unseen::vdtree {

// How a vertex is drawn: its colour scaled to its luminance.
glm::vec2 drawn_chroma(const glm::vec4& colour, float luminance);

// By interior node: of the ring and of the subtree's proxies; where all leaves of a node lie at one point, of these alone. Empty where
// nothing has any colour that could be seen. Cost: one pass over the triangles and the nodes; parallel. Nothing where the mesh has no
// colours.
std::vector<ChromaRange> derive_ring_chroma(const TreeGeometry& geometry, const TreeParts& parts, std::span<const Unorm16> luminance);

inline constexpr ChromaRange no_chroma_yet{glm::vec2(1e30f), glm::vec2(-1e30f)};
ChromaRange unite(const ChromaRange& a, const ChromaRange& b);

} // namespace unseen::vdtree
