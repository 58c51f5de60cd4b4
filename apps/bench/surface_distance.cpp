#include "surface_distance.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace unseen::app {
namespace {

using vdtree::Index;

double segment_distance(glm::dvec3 p, glm::dvec3 a, glm::dvec3 b) {
    const double squared = glm::dot(b - a, b - a);
    const double t = squared > 0 ? std::clamp(glm::dot(p - a, b - a) / squared, 0.0, 1.0) : 0.0;
    return glm::distance(p, a + t * (b - a));
}

double triangle_distance(glm::dvec3 p, glm::dvec3 a, glm::dvec3 b, glm::dvec3 c) {
    const glm::dvec3 n = glm::cross(b - a, c - a);
    const double squared = glm::dot(n, n);
    const auto is_inside = [&](glm::dvec3 from, glm::dvec3 to) {
        return glm::dot(glm::cross(to - from, p - from), n) >= 0;
    };
    if (squared > 0 && is_inside(a, b) && is_inside(b, c) && is_inside(c, a))
        return std::abs(glm::dot(p - a, n)) / std::sqrt(squared);
    return std::min({segment_distance(p, a, b), segment_distance(p, b, c), segment_distance(p, c, a)});
}

} // namespace

SurfaceDistance::SurfaceDistance(const vdtree::Mesh& mesh) : mesh_(mesh) {
    glm::dvec3 high = low_ = mesh.positions[mesh.triangles[0][0]];
    for (const vdtree::Triangle& t : mesh.triangles)
        for (const Index v : t) {
            low_ = glm::min(low_, mesh.positions[v]);
            high = glm::max(high, mesh.positions[v]);
        }
    const glm::dvec3 size = high - low_;
    cell_ = std::max({size.x, size.y, size.z}) / cells;
    lists_.resize(std::size_t{cells} * cells * cells);
    for (Index t = 0; t < mesh.triangles.size(); ++t) {
        const auto p = [&](std::size_t k) { return mesh.positions[mesh.triangles[t][k]]; };
        const glm::ivec3 from = cell_of(glm::min(p(0), glm::min(p(1), p(2))));
        const glm::ivec3 to = cell_of(glm::max(p(0), glm::max(p(1), p(2))));
        for (int z = from.z; z <= to.z; ++z)
            for (int y = from.y; y <= to.y; ++y)
                for (int x = from.x; x <= to.x; ++x) lists_[number_of({x, y, z})].push_back(t);
    }
}

glm::ivec3 SurfaceDistance::cell_of(glm::dvec3 p) const {
    return glm::clamp(glm::ivec3(glm::floor((p - low_) / cell_)), glm::ivec3(0), glm::ivec3(cells - 1));
}

std::size_t SurfaceDistance::number_of(glm::ivec3 cell) const {
    return static_cast<std::size_t>((cell.z * cells + cell.y) * cells + cell.x);
}

// Looks through shells of cells around the point's until none farther out can hold anything nearer.
double SurfaceDistance::operator()(glm::dvec3 p) const {
    const glm::ivec3 c = cell_of(p);
    const double outside = glm::distance(p, glm::clamp(p, low_, low_ + cell_ * cells)); // from the grid
    double nearest = std::numeric_limits<double>::infinity();
    for (int r = 0; r < cells && nearest > std::max(outside, (r - 1) * cell_); ++r) {
        const glm::ivec3 from = glm::max(c - r, glm::ivec3(0)), to = glm::min(c + r, glm::ivec3(cells - 1));
        for (int z = from.z; z <= to.z; ++z)
            for (int y = from.y; y <= to.y; ++y)
                for (int x = from.x; x <= to.x; ++x) {
                    if (std::max({std::abs(x - c.x), std::abs(y - c.y), std::abs(z - c.z)}) != r) continue;
                    for (const Index t : lists_[number_of({x, y, z})]) {
                        const vdtree::Triangle& corners = mesh_.triangles[t];
                        nearest = std::min(nearest,
                                           triangle_distance(p, mesh_.positions[corners[0]],
                                                             mesh_.positions[corners[1]], mesh_.positions[corners[2]]));
                    }
                }
    }
    return nearest;
}

double mean_surface_distance(const vdtree::Mesh& original, const vdtree::Mesh& simple) {
    if (simple.triangles.empty()) return std::numeric_limits<double>::quiet_NaN();
    glm::dvec3 low = original.positions[0], high = low;
    for (const glm::dvec3& p : original.positions) {
        low = glm::min(low, p);
        high = glm::max(high, p);
    }
    const glm::dvec3 size = high - low;
    const SurfaceDistance distance(simple);
    constexpr std::size_t sample = 20'000;
    const std::size_t step = original.positions.size() / sample | 1; // odd: not the same corner of every quad
    double sum = 0, count = 0;
    for (std::size_t v = 0; v < original.positions.size(); v += step, ++count) sum += distance(original.positions[v]);
    return sum / count / std::max({size.x, size.y, size.z});
}

} // namespace unseen::app
