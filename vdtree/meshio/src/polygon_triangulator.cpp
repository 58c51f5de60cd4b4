// Ear clipping after G. Meisters, Polygons have ears, Amer. Math. Monthly 82 (1975).
#include "polygon_triangulator.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace unseen::meshio {

namespace {

double cross(glm::dvec2 origin, glm::dvec2 a, glm::dvec2 b) {
    return (a.x - origin.x) * (b.y - origin.y) - (a.y - origin.y) * (b.x - origin.x);
}

// What a corner needs to be cut off; each step is tried only when no corner passes the one before.
enum Strictness { proper_ear, touching_ear, collinear, convex, any };

// Closing the gap behind a cut corner moves the later ones, about sixteen in the time of one test.
constexpr std::size_t moves_per_test = 16;

} // namespace

std::span<const Triangle> PolygonTriangulator::cut(std::span<const glm::dvec3> positions) {
    triangles_.clear();
    const std::size_t count = positions.size();
    if (count < 3) return triangles_;
    ring_.resize(count);
    std::iota(ring_.begin(), ring_.end(), Index{0});
    if (count == 3 || !project(positions) || is_convex()) fan(ring_);
    else clip_ears();
    return triangles_;
}

// Drops the axis along which the polygon's normal is longest. False where the polygon has no plane.
bool PolygonTriangulator::project(std::span<const glm::dvec3> positions) {
    glm::dvec3 extent(0.0);
    for (const glm::dvec3& p : positions)
        for (int i = 0; i < 3; ++i) extent[i] = std::max(extent[i], std::abs(p[i] - positions[0][i]));
    // To the unit box, so that neither 1e-19 nor 1e30 leaves the range of double when multiplied.
    const double size = std::max({extent.x, extent.y, extent.z});
    if (!(size > 0.0) || !std::isfinite(size) || !std::isfinite(1.0 / size)) return false;

    glm::dvec3 normal(0.0);
    glm::dvec3 previous = (positions.back() - positions[0]) / size;
    for (const glm::dvec3& position : positions) {
        const glm::dvec3 p = (position - positions[0]) / size;
        normal.x += (previous.y - p.y) * (previous.z + p.z);
        normal.y += (previous.z - p.z) * (previous.x + p.x);
        normal.z += (previous.x - p.x) * (previous.y + p.y);
        previous = p;
    }
    int axis = 0;
    for (int i = 1; i < 3; ++i)
        if (std::abs(normal[i]) > std::abs(normal[axis])) axis = i;
    if (!(std::abs(normal[axis]) > 0.0)) return false;

    // Cyclic order of the other two axes keeps the orientation; a normal that points down the axis needs the swap.
    int u = (axis + 1) % 3;
    int v = (axis + 2) % 3;
    if (normal[axis] < 0.0) std::swap(u, v);
    points_.clear();
    for (const glm::dvec3& position : positions) {
        const glm::dvec3 p = (position - positions[0]) / size;
        points_.emplace_back(p[u], p[v]);
    }
    return true;
}

// No right turn, and one turn around in all: a star polygon turns left everywhere but goes round twice.
bool PolygonTriangulator::is_convex() const {
    const std::size_t count = points_.size();
    int x_reversals = 0;
    double last_step = 0.0;
    double first_step = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
        const glm::dvec2 a = points_[i];
        const glm::dvec2 b = points_[(i + 1) % count];
        if (cross(a, b, points_[(i + 2) % count]) < 0.0) return false;
        const double step = b.x - a.x;
        if (step == 0.0) continue;
        if (first_step == 0.0) first_step = step;
        if (last_step != 0.0 && (step > 0.0) != (last_step > 0.0)) ++x_reversals;
        last_step = step;
    }
    if ((first_step > 0.0) != (last_step > 0.0)) ++x_reversals;
    return x_reversals <= 2;
}

void PolygonTriangulator::fan(std::span<const Index> ring) {
    for (std::size_t i = 2; i < ring.size(); ++i) triangles_.push_back({ring[0], ring[i - 1], ring[i]});
}

void PolygonTriangulator::clip_ears() {
    std::size_t at = 0;
    std::size_t misses = 0;
    int strictness = proper_ear;
    while (ring_.size() > 3 && tests_left_ > 0) {
        const std::size_t count = ring_.size();
        at %= count;
        if (!is_ear(at, strictness)) {
            ++at;
            if (++misses == count) {
                ++strictness;
                misses = 0;
            }
            continue;
        }
        triangles_.push_back({ring_[(at + count - 1) % count], ring_[at], ring_[(at + 1) % count]});
        ring_.erase(ring_.begin() + static_cast<std::ptrdiff_t>(at));
        tests_left_ -= static_cast<std::int64_t>(count / moves_per_test);
        // The corner after the cut one stays at `at`; going on from there avoids long slivers around one corner.
        strictness = proper_ear;
        misses = 0;
    }
    if (ring_.size() > 3) ++fanned_concave_;
    fan(ring_);
}

bool PolygonTriangulator::is_ear(std::size_t at, int strictness) {
    --tests_left_;
    if (strictness == any) return true;
    const std::size_t count = ring_.size();
    const glm::dvec2 a = points_[ring_[(at + count - 1) % count]];
    const glm::dvec2 b = points_[ring_[at]];
    const glm::dvec2 c = points_[ring_[(at + 1) % count]];
    const double area = cross(a, b, c);
    if (strictness == collinear) return area == 0.0;
    if (!(area > 0.0)) return false;
    if (strictness == convex) return true;

    tests_left_ -= static_cast<std::int64_t>(count);
    const glm::dvec2 low(std::min({a.x, b.x, c.x}), std::min({a.y, b.y, c.y}));
    const glm::dvec2 high(std::max({a.x, b.x, c.x}), std::max({a.y, b.y, c.y}));
    for (const Index other : ring_) {
        const glm::dvec2 p = points_[other];
        if (p.x < low.x || p.x > high.x || p.y < low.y || p.y > high.y) continue;
        // Polygons with holes come as one ring with a doubled bridge: copies of the corners block nothing.
        if (p == a || p == b || p == c) continue;
        const double ab = cross(a, b, p);
        const double bc = cross(b, c, p);
        const double ca = cross(c, a, p);
        const bool is_inside =
            strictness == proper_ear ? ab >= 0.0 && bc >= 0.0 && ca >= 0.0 : ab > 0.0 && bc > 0.0 && ca > 0.0;
        if (is_inside) return false;
    }
    return true;
}

} // namespace unseen::meshio
