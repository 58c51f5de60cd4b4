#include "bounding_sphere.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <glm/geometric.hpp>

namespace unseen::vdtree {

namespace {

// A point counts as contained up to this share of the radius, so that rounding does not make Welzl's recursion cycle.
constexpr double containment_slack = 1e-12;
// enclosing_sphere() stops when no sphere sticks out by more than this share of the radius ...
constexpr double sphere_slack = 1e-4;
// ... or after so many rounds; the radius is grown to the exact need in either case.
constexpr int most_rounds = 24;

bool contains(const DSphere& sphere, glm::dvec3 p) {
    return sphere.radius >= 0 && glm::distance(sphere.centre, p) <= sphere.radius * (1 + containment_slack);
}

// The smallest sphere with all of up to four points on its surface. Where they are (nearly) dependent, the last
// point is left out: its sphere is then found through another boundary set.
DSphere circumsphere(const glm::dvec3* p, int n) {
    if (n == 0) return {};
    if (n == 1) return {p[0], 0};
    // Solve for the centre p0 + sum x_i d_i with |centre - p0| = |centre - p_i|: 2 (d_i . d_j) x = d_i . d_i.
    double a[3][4];
    const int m = n - 1;
    glm::dvec3 d[3];
    for (int i = 0; i < m; ++i) d[i] = p[i + 1] - p[0];
    for (int i = 0; i < m; ++i) {
        for (int j = 0; j < m; ++j) a[i][j] = 2 * glm::dot(d[i], d[j]);
        a[i][m] = glm::dot(d[i], d[i]);
    }
    for (int k = 0; k < m; ++k) {
        int pivot = k;
        for (int i = k + 1; i < m; ++i)
            if (std::abs(a[i][k]) > std::abs(a[pivot][k])) pivot = i;
        std::swap_ranges(a[k], a[k] + 4, a[pivot]);
        if (!(std::abs(a[k][k]) > 1e-14 * a[0][0])) return circumsphere(p, n - 1);
        for (int i = 0; i < m; ++i) {
            if (i == k) continue;
            const double f = a[i][k] / a[k][k];
            for (int j = k; j <= m; ++j) a[i][j] -= f * a[k][j];
        }
    }
    glm::dvec3 offset(0);
    for (int i = 0; i < m; ++i) offset += a[i][m] / a[i][i] * d[i];
    return {p[0] + offset, glm::length(offset)};
}

DSphere welzl(std::span<glm::dvec3> points, std::size_t n, glm::dvec3* boundary, int on_boundary) {
    DSphere sphere = circumsphere(boundary, on_boundary);
    if (on_boundary == 4) return sphere;
    for (std::size_t i = 0; i < n; ++i) {
        if (contains(sphere, points[i])) continue;
        boundary[on_boundary] = points[i];
        sphere = welzl(points, i, boundary, on_boundary + 1);
        std::rotate(points.begin(), points.begin() + static_cast<std::ptrdiff_t>(i),
                    points.begin() + static_cast<std::ptrdiff_t>(i) + 1);
    }
    return sphere;
}

} // namespace

DSphere smallest_sphere(std::span<const glm::dvec3> points) {
    if (points.empty()) return {};
    // Relative to the first point and to the largest extent: precision does not depend on where the points are.
    const glm::dvec3 origin = points[0];
    double extent = 0;
    for (const glm::dvec3& p : points) {
        const glm::dvec3 d = glm::abs(p - origin);
        extent = std::max({extent, d.x, d.y, d.z});
    }
    if (extent == 0) return {origin, 0};
    static thread_local std::vector<glm::dvec3> scaled;
    scaled.clear();
    for (const glm::dvec3& p : points) scaled.push_back((p - origin) / extent);
    glm::dvec3 boundary[4];
    DSphere sphere = welzl(scaled, scaled.size(), boundary, 0);
    sphere.centre = sphere.centre * extent + origin;
    sphere.radius = 0;
    for (const glm::dvec3& p : points) sphere.radius = std::max(sphere.radius, glm::distance(sphere.centre, p));
    return sphere;
}

DSphere enclosing_sphere(std::span<const glm::dvec3> points, std::span<const DSphere> spheres) {
    // Cutting planes: a sphere that sticks out of the current answer adds its farthest point to the point set. The
    // point sets' smallest spheres are lower bounds, so the last one is nearly the smallest.
    std::vector<glm::dvec3> all(points.begin(), points.end());
    for (const DSphere& s : spheres)
        if (s.radius >= 0) all.push_back(s.centre);
    DSphere result = smallest_sphere(all);
    for (int round = 0; round < most_rounds; ++round) {
        double reach = result.radius;
        const DSphere* farthest = nullptr;
        for (const DSphere& s : spheres) {
            if (s.radius < 0) continue;
            const double r = glm::distance(result.centre, s.centre) + s.radius;
            if (r > reach) {
                reach = r;
                farthest = &s;
            }
        }
        const bool done = !farthest || reach <= result.radius * (1 + sphere_slack) || round + 1 == most_rounds;
        if (done) {
            result.radius = reach;
            break;
        }
        const glm::dvec3 away = farthest->centre - result.centre;
        const double length = glm::length(away);
        const glm::dvec3 direction = length > 0 ? away / length : glm::dvec3(1, 0, 0);
        all.push_back(farthest->centre + direction * farthest->radius);
        if (!(length > 0)) all.push_back(farthest->centre - direction * farthest->radius);
        result = smallest_sphere(all);
    }
    return result;
}

Sphere round_outward(const DSphere& sphere) {
    if (sphere.radius < 0) return {};
    Sphere out;
    out.centre = glm::vec3(sphere.centre);
    const double moved = glm::distance(glm::dvec3(out.centre), sphere.centre);
    if (sphere.radius == 0 && moved == 0) return out;
    // Doubles carry the sum and the distances of the containment test; a few units in their last place cover them.
    const double needed = (sphere.radius + moved) * (1 + 8 * std::numeric_limits<double>::epsilon());
    out.radius = static_cast<float>(needed);
    if (static_cast<double>(out.radius) < needed)
        out.radius = std::nextafter(out.radius, std::numeric_limits<float>::infinity());
    return out;
}

} // namespace unseen::vdtree
