#include <unseen/vdtree/internal/normal_mask.h>

#include <numbers>

#include <glm/geometric.hpp>

#include "tree/directions.h"

namespace unseen::vdtree {

namespace {

constexpr int cells_per_side = 8;

// Covers the rounding of the cell's index and of the products in facing(): share of a unit vector, and radians.
constexpr double cell_margin = 1e-5;

constexpr double inverse_sqrt3 = 0.57735026918962576451; // the diagonals' coordinates
constexpr double slab_units = 127;                       // of NormalSlabs in 1
constexpr double slab_margin = 1e-4;                     // units; covers the rounding of unit vectors in floats

// The cube coordinate -1..1 of the warped coordinate -1..1: equal steps are equal angles along the axis.
double unwarp(double warped) { return std::tan(warped * (std::numbers::pi / 4)); }

// The point of the cube's face `face` (axis * 2 + sign) with the coordinates u, v on the two other axes.
glm::dvec3 on_face(int face, double u, double v) {
    const int axis = face / 2;
    glm::dvec3 p;
    p[axis] = face % 2 ? -1 : 1;
    p[(axis + 1) % 3] = u;
    p[(axis + 2) % 3] = v;
    return p;
}

std::array<NormalCell, normal_cell_count> make_cells() {
    std::array<NormalCell, normal_cell_count> cells;
    for (int face = 0; face < 6; ++face) {
        for (int row = 0; row < cells_per_side; ++row) {
            for (int column = 0; column < cells_per_side; ++column) {
                NormalCell& cell = cells[static_cast<std::size_t>(face * 64 + row * cells_per_side + column)];
                for (int corner = 0; corner < 4; ++corner) {
                    const double u = unwarp((column + corner % 2) * 2.0 / cells_per_side - 1);
                    const double v = unwarp((row + corner / 2) * 2.0 / cells_per_side - 1);
                    const glm::vec3 p(glm::normalize(on_face(face, u, v)));
                    const auto k = static_cast<std::size_t>(corner);
                    cell.x[k] = p.x, cell.y[k] = p.y, cell.z[k] = p.z;
                }
            }
        }
    }
    return cells;
}

} // namespace

int normal_cell(glm::dvec3 normal) noexcept {
    const glm::dvec3 size = glm::abs(normal);
    const double largest = std::max({size.x, size.y, size.z});
    if (!(largest > 0) || !std::isfinite(size.x + size.y + size.z)) return -1;
    return cell_of(normal, largest);
}

const std::array<NormalCell, normal_cell_count>& normal_cells() noexcept {
    static const std::array<NormalCell, normal_cell_count> cells = make_cells();
    return cells;
}

Facing facing(const NormalMask& mask, glm::vec3 to_eye, float distance, float radius) noexcept {
    if (mask.empty()) return Facing::none;
    if (!(distance > radius)) return Facing::mixed;
    // A normal n faces the eye from every point of the sphere iff the angle between n and to_eye is below 90 degrees
    // less asin(radius / distance): n . to_eye > radius / distance. That is a cap, so the cells' corners decide.
    const float limit = radius / distance + static_cast<float>(cell_margin);
    const auto& cells = normal_cells();
    bool some_front = false, some_back = false;
    for (std::size_t face = 0; face < 6; ++face) {
        for (std::uint64_t bits = mask.faces[face]; bits; bits &= bits - 1) {
            const NormalCell& cell = cells[face * 64 + static_cast<std::size_t>(std::countr_zero(bits))];
            float lowest = 2, highest = -2;
            for (std::size_t k = 0; k < 4; ++k) {
                const float towards = cell.x[k] * to_eye.x + cell.y[k] * to_eye.y + cell.z[k] * to_eye.z;
                lowest = std::min(lowest, towards);
                highest = std::max(highest, towards);
            }
            if (lowest > limit) some_front = true;
            else if (highest < -limit) some_back = true;
            else return Facing::mixed;
            if (some_front && some_back) return Facing::mixed;
        }
    }
    return some_front ? Facing::front : Facing::back;
}

void NormalSlabs::insert(glm::dvec3 n) noexcept {
    SlabCoordinates<double> along = along_slab_axes(n.x, n.y, n.z);
    for (double& coordinate : along) coordinate = std::clamp(coordinate, -1.0, 1.0);
    *this |= slabs_between(along, along, slab_margin);
}

namespace {

// A slab as floats, in units of 1/127.
struct Slab {
    float lo, hi;
    float largest(float weight) const { return std::max(weight * lo, weight * hi); }
    float reach() const { return std::max(-lo, hi); } // the largest absolute coordinate
};

// Whether all directions in the slabs have n . u below -sine. Three independent slabs make a parallelepiped, whose
// largest n . u is a sum; tried are the box of x, y and z, and those with a diagonal in place of one of the three.
//
// A parallelepiped reaches out of the unit sphere, to `reach`, so `sine` is multiplied by that: then a node that is not
// ruled out has no ancestor that is (whose sphere contains its sphere, and whose slabs contain its slabs), for any
// point x of the parallelepiped, x . (eye - centre) changes by at most reach * (radius of the ancestor - radius).
// For the same reason every node tries the same parallelepipeds.
bool all_below(const std::array<Slab, NormalSlabs::axis_count>& slabs, glm::vec3 u, float sine) {
    const auto below = [sine](float largest, auto squared_reach) {
        if (!(largest < -sine * static_cast<float>(slab_units))) return false; // reach is at least 1
        return largest < -sine * std::sqrt(squared_reach()) - static_cast<float>(cell_margin * slab_units);
    };
    const float reach2[3] = {slabs[0].reach() * slabs[0].reach(), slabs[1].reach() * slabs[1].reach(),
                             slabs[2].reach() * slabs[2].reach()};
    const float along[3] = {slabs[0].largest(u.x), slabs[1].largest(u.y), slabs[2].largest(u.z)};
    if (below(along[0] + along[1] + along[2], [&] { return reach2[0] + reach2[1] + reach2[2]; })) return true;
    constexpr float sqrt3 = static_cast<float>(1 / inverse_sqrt3);
    constexpr float signs[4][3] = {{1, 1, 1}, {-1, 1, 1}, {1, -1, 1}, {1, 1, -1}};
    for (std::size_t d = 0; d < 4; ++d) {
        const Slab& diagonal = slabs[3 + d];
        for (int k = 0; k < 3; ++k) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            const float sk = signs[d][k], si = signs[d][i], sj = signs[d][j];
            // u = weight * diagonal + rest along i and j.
            const float weight = u[k] * sk;
            const Slab &a = slabs[static_cast<std::size_t>(i)], &b = slabs[static_cast<std::size_t>(j)];
            const float largest =
                diagonal.largest(weight * sqrt3) + a.largest(u[i] - weight * si) + b.largest(u[j] - weight * sj);
            const auto squared_reach = [&] {
                // The replaced coordinate: sk * (sqrt3 * diagonal - si * a - sj * b), as an interval.
                const float high = sqrt3 * diagonal.hi + a.largest(-si) + b.largest(-sj);
                const float low = sqrt3 * diagonal.lo - a.largest(si) - b.largest(sj);
                const float r = std::max(-low, high);
                return r * r + reach2[i] + reach2[j];
            };
            if (below(largest, squared_reach)) return true;
        }
    }
    return false;
}

} // namespace

Facing facing(const NormalSlabs& slabs, glm::vec3 to_eye, float distance, float radius) noexcept {
    if (slabs.empty()) return Facing::none;
    if (!(distance > radius)) return Facing::mixed;
    std::array<Slab, NormalSlabs::axis_count> wide;
    for (std::size_t i = 0; i < wide.size(); ++i)
        wide[i] = {static_cast<float>(slabs.lo[i]), static_cast<float>(slabs.hi[i])};
    const float sine = radius / distance;
    if (all_below(wide, -to_eye, sine)) return Facing::front;
    return all_below(wide, to_eye, sine) ? Facing::back : Facing::mixed;
}

} // namespace unseen::vdtree
