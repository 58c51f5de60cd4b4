// Colour beside luminance, in the two opponent directions in which eyes see it.
#pragma once

#include <cmath>

#include <glm/common.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include <unseen/vdtree/colour.h>
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

// The linear RGB that has this luminance and this chroma.
inline glm::dvec3 rgb_of(double luminance, glm::dvec2 chroma) {
    glm::dmat3 channels; // by primary
    for (int k = 0; k < 3; ++k) {
        glm::dvec3 primary(0);
        primary[k] = 1;
        channels[k] = glm::dvec3(rec709_luminance(primary), opponent_chroma(primary));
    }
    return glm::inverse(channels) * glm::dvec3(luminance, chroma);
}

// A difference of chroma is seen at most this many times as well as the same difference of luminance. These are the
// ratios of castleCSF's sensitivities from 2 to 8 cpd and 5 to 100 cd/m2, within 15 degrees of the gaze. At higher
// frequencies, lower luminances and farther out they may be larger; judges show what that comes to (docs/evidence.md).
inline constexpr glm::dvec2 chroma_over_luminance(2, 0.5);

// Linear RGB as three numbers of which the root of the sum of squares counts as luminance does: the luminance, and what
// the chroma is as good as.
template <class T>
constexpr glm::vec<3, T> as_luminances(const glm::vec<3, T>& rgb) {
    const glm::dvec2 chroma = chroma_over_luminance * opponent_chroma(glm::dvec3(rgb));
    return {rec709_luminance(rgb), static_cast<T>(chroma.x), static_cast<T>(chroma.y)};
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

// Whether anything that is drawn has a colour: vertices, or texels whose codes differ by more than compression makes of
// greys. Cost: a pass over both at most.
bool has_colours(const vdtree::VertexTree& tree);

// How a vertex is drawn: its colour scaled to its luminance; grey where the colour has none.
glm::vec3 drawn_colour(const glm::vec4& colour, float luminance);
glm::vec2 drawn_chroma(const glm::vec4& colour, float luminance);

// As a difference of luminance that is seen as well.
inline float as_luminance(const ChromaRange& range) {
    const glm::vec2 difference = glm::vec2(chroma_over_luminance) * (range.hi - range.lo);
    return std::sqrt(difference.x * difference.x + difference.y * difference.y);
}

// The chromas of all that a tree draws, and of grey. Textures count as on the brightest vertex. Cost: a pass over the
// vertices and texels.
ChromaRange colour_reach(const vdtree::VertexTree& tree);

inline ChromaRange unite(const ChromaRange& a, const ChromaRange& b) {
    return {glm::min(a.lo, b.lo), glm::max(a.hi, b.hi)};
}

} // namespace unseen::perception
