// Colour beside luminance, in the two opponent directions in which eyes see it.
#pragma once

#include <glm/common.hpp>

#include <unseen/vdtree/vertex_tree.h>

namespace unseen::perception {

// The chroma of linear RGB (Rec. 709): x towards red (negative: green), y towards violet (negative: yellow), in units
// of relative luminance. White and all greys have (0, 0); pure red of the luminance 0.2126 has (0.121, -0.205), pure
// blue of 0.0722 (-0.035, 0.801). Linear, so interpolated colours lie between those they are interpolated from.
//
// These are L - k M and k' S - (L + M) of the cones' responses (CIE 2006, 2 degrees, from CIE 1931 XYZ on an LED
// display by the matrix that castleCSF's program uses), over L + M of white; k and k' such that white (D65) has
// neither.
constexpr glm::dvec2 opponent_chroma(glm::dvec3 rgb) {
    return {0.12104624328257559 * rgb.r - 0.08561811545777649 * rgb.g - 0.0354281278247991 * rgb.b,
            -0.20453379289306542 * rgb.r - 0.5968319963708706 * rgb.g + 0.801365789263936 * rgb.b};
}

// The range in both directions, by component.
struct ChromaRange {
    glm::vec2 lo = glm::vec2(0);
    glm::vec2 hi = glm::vec2(0);
    bool operator==(const ChromaRange&) const = default;
};

// Whether a vertex or proxy has a colour that could be seen as it is drawn, its colour scaled to its luminance. Cost:
// one pass over the nodes at most; nothing where the mesh has no colours. Textures are not looked at.
bool has_chroma(const vdtree::VertexTree& tree);

// By interior node: the chroma of the ring and of the subtree's proxies. Includes the children's. Empty where
// has_chroma() is false. Cost: one pass over the triangles and the nodes, in parallel; so a tree for which nobody asks
// pays nothing. Fails where VertexTree::check() does.
Result<std::vector<ChromaRange>> ring_chroma(const vdtree::VertexTree& tree);

// How a vertex is drawn: its colour scaled to its luminance.
glm::vec2 drawn_chroma(const glm::vec4& colour, float luminance);

inline ChromaRange unite(const ChromaRange& a, const ChromaRange& b) {
    return {glm::min(a.lo, b.lo), glm::max(a.hi, b.hi)};
}

} // namespace unseen::perception
