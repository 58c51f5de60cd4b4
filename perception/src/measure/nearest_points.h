// Triangles of a ring, and the nearest points of a surface of them to given points.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include <glm/geometric.hpp>

#include "measure/fold_picture.h"
#include "measure/registers.h"

namespace unseen::perception {

// A triangle of a ring before or after the fold, with this many luminances at each corner.
template <std::size_t count>
struct RingTriangle {
    LitPointOf<count> corner[3];
    unsigned inside = 0; // a bit for each corner in the support
};

// Points by columns, so that a surface is compared with eight at once, and the nearest points of that surface.
template <std::size_t count>
class ComparedPoints {
public:
    using Point = LitPointOf<count>;
    static constexpr std::size_t lanes = 8;

    void clear() { points_.clear(); }
    void add(const Point& p) { points_.push_back(p); }
    std::size_t size() const { return points_.size(); }

    // Columns of the points from `first` on; after the last point it is repeated.
    struct alignas(32) Block {
        float x[lanes], y[lanes], z[lanes];
        float squared[lanes], luminance[count][lanes]; // the distance to the nearest point, and its luminances
    };
    std::span<Block> blocks() {
        blocks_.resize((size() + lanes - 1) / lanes);
        for (std::size_t i = 0; i < blocks_.size() * lanes; ++i) {
            const glm::vec3& p = points_[std::min(i, size() - 1)].position;
            Block& to = blocks_[i / lanes];
            to.x[i % lanes] = p.x, to.y[i % lanes] = p.y, to.z[i % lanes] = p.z;
        }
        return blocks_;
    }
    // Once the blocks are compared: the distance to the nearest point, and what is here and there.
    float distance(std::size_t i) const { return std::sqrt(blocks_[i / lanes].squared[i % lanes]); }
    std::array<float, count> here(std::size_t i) const {
        std::array<float, count> all;
        for (std::size_t k = 0; k < count; ++k) all[k] = points_[i].luminance[k];
        return all;
    }
    std::array<float, count> there(std::size_t i) const {
        std::array<float, count> all;
        for (std::size_t k = 0; k < count; ++k) all[k] = blocks_[i / lanes].luminance[k][i % lanes];
        return all;
    }

private:
    std::vector<Point> points_;
    std::vector<Block> blocks_;
};

template <std::size_t count>
class Surface {
public:
    using Block = typename ComparedPoints<count>::Block;

    void assign(std::span<const RingTriangle<count>> ring) {
        triangles_.clear();
        for (const auto& [corner, inside] : ring) {
            const auto& [a, b, c] = corner;
            const glm::vec3 ab = b.position - a.position, ac = c.position - a.position;
            const float bb = glm::dot(ab, ab), bc = glm::dot(ab, ac), cc = glm::dot(ac, ac);
            const float determinant = bb * cc - bc * bc;
            PreparedTriangle& t = triangles_.emplace_back();
            t.a = a.position, t.b = ab, t.c = ac;
            t.bb = bb, t.bc = bc, t.cc = cc;
            t.along_b = divisor(bb), t.along_c = divisor(cc), t.along_bc = divisor(bb - 2 * bc + cc);
            t.inverse = determinant > least_determinant * bb * cc ? 1 / determinant : 0;
            for (std::size_t i = 0; i < count; ++i) {
                t.luminance[i] = a.luminance[i];
                t.luminance_b[i] = b.luminance[i] - a.luminance[i], t.luminance_c[i] = c.luminance[i] - a.luminance[i];
            }
        }
    }
    bool empty() const { return triangles_.empty(); }

    // How the points differ from the nearest ones of the surface; of equally near ones, those of the first triangle.
    void compare(ComparedPoints<count>& points) const {
        for (Block& block : points.blocks())
            on_widest([&]<class Floats>() UNSEEN_INLINE_LAMBDA {
                for (std::size_t first = 0; first < ComparedPoints<count>::lanes; first += width_of<Floats>)
                    find<Floats>(triangles_, block, first);
            });
    }

private:
    static constexpr float infinitely_far = std::numeric_limits<float>::infinity();
    // Triangles whose area is less than a thousandth of their edges' squares count by their edges.
    static constexpr float least_determinant = 1e-6f;

    struct PreparedTriangle {
        glm::vec3 a, b, c;                                            // b and c from a
        std::array<float, count> luminance, luminance_b, luminance_c; // a's; the others' less that
        float bb, bc, cc;                                             // products
        float along_b, along_c, along_bc;                             // what lengths along the edges are divided by
        float inverse;                                                // of the determinant; 0: only its edges count
    };
    // Of edges without a length, the first end is as near as any.
    static float divisor(float squared) { return squared > 0 ? squared : infinitely_far; }

    // The nearest point a + v b + w c of each triangle: of its inside, where the foot of the perpendicular lies there,
    // or of an edge. `Floats`: a register's.
    template <class Floats>
    static UNSEEN_INLINE void find(std::span<const PreparedTriangle> triangles, Block& points, std::size_t first) {
        const auto share = [](const Floats& part, float whole) UNSEEN_INLINE_LAMBDA {
            const Floats s = part / whole, above = s > 0 ? s : Floats{};
            return above < 1 ? above : Floats{} + 1;
        };
        const Floats x = floats_at<Floats>(points.x + first), y = floats_at<Floats>(points.y + first),
                     z = floats_at<Floats>(points.z + first);
        Floats nearest = Floats{} + infinitely_far, nearest_luminance[count] = {};
        for (const PreparedTriangle& t : triangles) {
            const Floats px = x - t.a.x, py = y - t.a.y, pz = z - t.a.z;
            const Floats pb = px * t.b.x + py * t.b.y + pz * t.b.z, pc = px * t.c.x + py * t.c.y + pz * t.c.z;
            const Floats v0 = (t.cc * pb - t.bc * pc) * t.inverse, w0 = (t.bb * pc - t.bc * pb) * t.inverse;
            const Floats on_ab = share(pb, t.along_b), on_ac = share(pc, t.along_c),
                         on_bc = share(pc - pb - t.bc + t.bb, t.along_bc), off_bc = 1 - on_bc;
            const Floats cost_ab = on_ab * (on_ab * t.bb - 2 * pb), cost_ac = on_ac * (on_ac * t.cc - 2 * pc),
                         cost_bc =
                             off_bc * (off_bc * t.bb + 2 * on_bc * t.bc - 2 * pb) + on_bc * (on_bc * t.cc - 2 * pc);
            const auto is_ab = cost_ab < cost_ac;
            const auto is_bc = cost_bc < (is_ab ? cost_ab : cost_ac);
            const auto is_inside = (Floats{} + t.inverse > 0) & (v0 >= 0) & (w0 >= 0) & (v0 + w0 <= 1);
            Floats v = is_ab ? on_ab : Floats{}, w = is_ab ? Floats{} : on_ac;
            v = is_bc ? off_bc : v;
            w = is_bc ? on_bc : w;
            v = is_inside ? v0 : v;
            w = is_inside ? w0 : w;
            const Floats dx = px - v * t.b.x - w * t.c.x, dy = py - v * t.b.y - w * t.c.y,
                         dz = pz - v * t.b.z - w * t.c.z;
            const Floats squared = dx * dx + dy * dy + dz * dz;
            const auto is_nearer = squared < nearest;
            nearest = is_nearer ? squared : nearest;
            for (std::size_t i = 0; i < count; ++i) {
                const Floats luminance = t.luminance[i] + v * t.luminance_b[i] + w * t.luminance_c[i];
                nearest_luminance[i] = is_nearer ? luminance : nearest_luminance[i];
            }
        }
        store(nearest, points.squared + first);
        for (std::size_t i = 0; i < count; ++i) store(nearest_luminance[i], points.luminance[i] + first);
    }
    std::vector<PreparedTriangle> triangles_;
};

} // namespace unseen::perception
