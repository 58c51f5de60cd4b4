// Small enclosing spheres of points and of spheres.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include <vdtree/vertex_tree.h>

namespace unseen::vdtree {

struct DSphere {
    glm::dvec3 centre = glm::dvec3(0);
    double radius = -1; // negative: contains nothing
};

// The smallest sphere that contains all points (Welzl 1991, move to front). Deterministic.
// Cost: expected linear for the sizes used here (tens of points).
DSphere smallest_sphere(std::span<const glm::dvec3> points);

// Nearly the smallest sphere that contains all points and all spheres: the radius exceeds the smallest one by a
// relative 1e-4 at most, and contains them all.
DSphere enclosing_sphere(std::span<const glm::dvec3> points, std::span<const DSphere> spheres);

// Points and spheres of one tree, to be enclosed again and again: keeps its memory, and looks for the farthest of several points
// per instruction.
class BallSet {
public:
    // `scale` brings the tree's extent to about 1, so that squares in floats neither overflow nor vanish.
    explicit BallSet(float scale) : scale_(scale) {}

    void clear() {
        count_ = 0;
        spheres_.clear();
    }
    void add(glm::vec3 point) {
        if (count_ == points_[0].size()) grow();
        for (int axis = 0; axis < 3; ++axis) points_[static_cast<std::size_t>(axis)][count_] = point[axis];
        ++count_;
    }
    void add(const Sphere& sphere) { spheres_.push_back(sphere); }

    // Contains everything; the radius exceeds the smallest one by a relative `slack` at most, but for the rounding of
    // positions relative to each other. There must be a point.
    DSphere enclose(double slack);

private:
    class Scaled;

    using Axes = std::array<std::vector<float>, 3>;

    void grow();
    void make_relative();

    float scale_;
    std::size_t count_ = 0; // of the points; there is room for more, in whole vectors
    Axes points_, relative_; // to the first, scaled
    std::vector<Sphere> spheres_;
    std::vector<DSphere> scaled_spheres_;
};

// The sphere in floats, grown so that it contains the given one in exact arithmetic.
Sphere round_outward(const DSphere& sphere);

} // namespace unseen::vdtree
