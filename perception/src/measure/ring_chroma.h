// The chroma of vertices as they are drawn.
#pragma once

#include <glm/common.hpp>
#include <glm/vec4.hpp>

#include <unseen/perception/internal/chroma.h>

namespace unseen::perception {

// How a vertex is drawn: its colour scaled to its luminance.
glm::vec2 drawn_chroma(const glm::vec4& colour, float luminance);

inline constexpr ChromaRange no_chroma_yet{glm::vec2(1e30f), glm::vec2(-1e30f)};
inline ChromaRange unite(const ChromaRange& a, const ChromaRange& b) {
    return {glm::min(a.lo, b.lo), glm::max(a.hi, b.hi)};
}

} // namespace unseen::perception
