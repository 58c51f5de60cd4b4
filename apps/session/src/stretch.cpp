#include "stretch.h"

#include <algorithm>
#include <cmath>

#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>

namespace unseen::session {
namespace {

// Beyond, what is thinnest is lost in the rounding of what is thickest.
constexpr double most_condition = 1e6;
constexpr int most_steps = 60; // of Newton's iteration, which doubles the digits: a few are enough

double largest_of(const glm::dmat3& m) {
    double largest = 0;
    for (int c = 0; c < 3; ++c)
        for (int r = 0; r < 3; ++r) largest = std::max(largest, std::abs(m[c][r]));
    return largest;
}

double norm(const glm::dmat3& m) {
    double sum = 0;
    for (int c = 0; c < 3; ++c) sum += glm::dot(m[c], m[c]);
    return std::sqrt(sum);
}

} // namespace

bool is_same_stretch(const glm::dmat3& a, const glm::dmat3& b) { return largest_of(a - b) <= same_stretch; }

std::optional<Factored> factor(const glm::dmat4& transform) {
    for (int c = 0; c < 4; ++c)
        for (int r = 0; r < 4; ++r)
            if (!std::isfinite(transform[c][r])) return std::nullopt;
    glm::dmat3 linear(transform);
    const double size = largest_of(linear);
    if (!(size > 0)) return std::nullopt;
    linear /= size; // a determinant of tiny scales would underflow
    const double determinant = glm::determinant(linear);
    const glm::dmat3 inverse = glm::inverse(linear);
    if (!(norm(linear) * norm(inverse) <= most_condition)) return std::nullopt; // NaN, too

    // Higham 1986: X becomes the mean of itself and its inverse transposed, both scaled to each other's size.
    glm::dmat3 turn = linear;
    for (int i = 0; i < most_steps; ++i) {
        const glm::dmat3 opposite = glm::transpose(glm::inverse(turn));
        const double scale = std::sqrt(norm(opposite) / norm(turn));
        const glm::dmat3 next = (turn * scale + opposite / scale) * 0.5;
        const double step = largest_of(next - turn);
        turn = next;
        constexpr double settled = 1e-15;
        if (step <= settled) break;
    }
    glm::dmat3 stretch = glm::transpose(turn) * linear;
    stretch = (stretch + glm::transpose(stretch)) * 0.5;
    const double scale = std::cbrt(std::abs(determinant));
    stretch /= scale;
    if (determinant < 0) turn = -turn, stretch = -stretch;

    Factored factored;
    factored.placement.scale = scale * size;
    factored.placement.rotation = glm::normalize(glm::quat_cast(turn));
    factored.placement.translation = glm::dvec3(transform[3]);
    if (!(factored.placement.scale > 0) || !std::isfinite(factored.placement.scale)) return std::nullopt;
    if (!is_same_stretch(stretch, glm::dmat3(1))) factored.stretch = stretch;
    return factored;
}

} // namespace unseen::session
