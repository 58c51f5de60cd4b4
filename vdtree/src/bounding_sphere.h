// Small enclosing spheres of points and of spheres.
#pragma once

#include <array>
#include <cstddef>
#include <cstring>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include <vdtree/function_ref.h>
#include <vdtree/vertex_tree.h>

namespace unseen::vdtree {

struct DSphere {
    glm::dvec3 centre = glm::dvec3(0);
    double radius = -1; // negative: contains nothing
};

// The smallest sphere that contains all points (Welzl 1991, move to front). Deterministic.
// Cost: expected linear for the sizes used here (tens of points).
DSphere smallest_sphere(std::span<const glm::dvec3> points);
// Likewise of points that somebody else keeps, one of which is `first`: asks now and then, ten times or so, for the one that is farthest
// from a place.
DSphere smallest_sphere(glm::dvec3 first, FunctionRef<glm::dvec3(glm::dvec3 from)> farthest);

// Nearly the smallest sphere that contains all points and all spheres: the radius exceeds the smallest one by a
// relative 1e-4 at most, and contains them all.
DSphere enclosing_sphere(std::span<const glm::dvec3> points, std::span<const DSphere> spheres);

// Points and spheres of one tree, to be enclosed again and again: keeps its memory, and looks for the farthest of several points
// per instruction.
class BallSet {
public:
    // `scale`, a power of two, brings the tree's extent to about 1, so that squares in floats neither overflow nor vanish.
    explicit BallSet(float scale) : scale_(scale) {}

    // Begins with a point, which the others are measured from.
    void begin(glm::vec3 point) {
        count_ = relative_count_ = 0;
        spheres_.clear();
        add(point);
    }
    void add(glm::vec3 point) {
        if (count_ == points_.size()) grow();
        std::memcpy(&points_[count_++], &point, sizeof(point));
    }
    void add(const Sphere& sphere) { spheres_.push_back(sphere); }
    void forget_spheres() { spheres_.clear(); }

    // Contains everything; the radius exceeds the smallest one by a relative `slack` at most, but for the rounding of
    // positions relative to each other.
    DSphere enclose(double slack);

private:
    class Scaled;
    using Point = float __attribute__((vector_size(16))); // the fourth number does not matter

    void grow();
    void make_relative();

    float scale_;
    std::size_t count_ = 0, relative_count_ = 0; // there is room for more, in whole vectors
    std::vector<Point> points_;
    std::array<std::vector<float>, 3> relative_; // to the first, scaled
    std::vector<Sphere> spheres_;
    std::vector<DSphere> scaled_spheres_;
};

// The sphere in floats, grown so that it contains the given one in exact arithmetic.
Sphere round_outward(const DSphere& sphere);
// A distance in floats that covers the given one and its rounding.
float round_up(double distance);

} // namespace unseen::vdtree
