// Affine transforms as a similarity after a stretch.
#pragma once

#include <optional>

#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>

#include <unseen/vdtree/view.h>

namespace unseen::session {

// placement.to_world(stretch * x) is the transform of x. The stretch is symmetric, of determinant 1 or, for mirror
// images, -1; the identity where the transform is a similarity.
struct Factored {
    vdtree::Similarity placement;
    glm::dmat3 stretch = glm::dmat3(1);
};

// Two stretches that differ by no more, in any component, count as one. Single floats of nested nodes are off by some
// 1e-6; an object as large as the largest screen, 32768 pixels, moves by a third of a pixel.
inline constexpr double same_stretch = 1e-5;
bool is_same_stretch(const glm::dmat3& a, const glm::dmat3& b);

// By polar decomposition. Nothing for a matrix that is not finite, or has no inverse.
std::optional<Factored> factor(const glm::dmat4& transform);

} // namespace unseen::session
