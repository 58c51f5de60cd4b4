#include "bounding_sphere.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include <glm/geometric.hpp>

namespace unseen::vdtree {

namespace {

// A point counts as contained up to this share of the radius, so that rounding does not change the basis for ever.
constexpr double containment_slack = 1e-12;
// The growth of a basis is given up after so many rounds, far more than it takes; the radius is then what it has to be.
constexpr int most_rounds = 64;
// Of the product of lengths: points flatter than this have no circumsphere worth calling so.
constexpr double least_flatness = 1e-14;

double squared(glm::dvec3 v) { return glm::dot(v, v); }

// Up to four points, and the smallest sphere around them, which they lie on.
class Basis {
public:
    Basis() = default;
    // The smallest sphere around two balls.
    Basis(const DSphere& a, const DSphere& b) {
        const glm::dvec3 apart = b.centre - a.centre;
        const double distance = glm::length(apart);
        if (distance + b.radius <= a.radius) {
            sphere_ = a;
            count_ = 0;
        } else if (distance + a.radius <= b.radius) {
            sphere_ = b;
            count_ = 0;
        } else {
            points_[0] = a.centre, points_[1] = b.centre;
            if (a.radius != 0 || b.radius != 0) {
                const glm::dvec3 direction = apart / distance;
                points_[0] -= direction * a.radius;
                points_[1] += direction * b.radius;
            }
            sphere_ = {(points_[0] + points_[1]) * 0.5, (distance + a.radius + b.radius) * 0.5};
            count_ = 2;
        }
    }

    const DSphere& sphere() const { return sphere_; }

    // Makes the smallest sphere around the basis and what of a ball is farthest outside of its sphere.
    void add(const DSphere& ball) {
        if (ball.radius == 0) return add(ball.centre);
        const glm::dvec3 away = ball.centre - sphere_.centre;
        const double length = glm::length(away);
        const glm::dvec3 direction = length > 0 ? away / length : glm::dvec3(1, 0, 0);
        add(ball.centre + direction * ball.radius);
    }

private:
    // Makes the smallest sphere around the basis and a point outside of its sphere.
    void add(glm::dvec3 p) {
        if (count_ == 0) {
            // The sphere is a single ball: the point opposite stands for it.
            const glm::dvec3 away = p - sphere_.centre;
            points_[0] = sphere_.centre - away * (sphere_.radius / glm::length(away));
            count_ = 1;
        }
        Best best;
        for (int i = 0; i < count_ && !best.found; ++i) {
            const glm::dvec3 half = (at(i) - p) * 0.5;
            consider(best, {p + half, squared(half)}, {i});
        }
        // A pair's sphere that contains the others is the smallest, but one of more points need not be.
        if (!best.found) {
            for (int i = 0; i < count_; ++i)
                for (int j = i + 1; j < count_; ++j) consider(best, around(p, at(i), at(j)), {i, j});
            for (int i = 0; i < count_; ++i)
                for (int j = i + 1; j < count_; ++j)
                    for (int k = j + 1; k < count_; ++k) consider(best, around(p, at(i), at(j), at(k)), {i, j, k});
        }
        if (!best.found) {
            // Rounding has left nothing: keep the sphere in the place of its basis.
            *this = Basis(sphere_, {p, 0});
            return;
        }
        std::array<glm::dvec3, 4> kept;
        int count = 0;
        for (int i = 0; i < 3; ++i)
            if (best.with[static_cast<std::size_t>(i)] >= 0)
                kept[static_cast<std::size_t>(count++)] = at(best.with[static_cast<std::size_t>(i)]);
        kept[static_cast<std::size_t>(count++)] = p;
        points_ = kept;
        count_ = count;
        sphere_ = {best.sphere.centre, std::sqrt(best.sphere.squared_radius)};
    }

    struct Subset {
        std::array<int, 3> with{-1, -1, -1};
        Subset(std::initializer_list<int> which) { std::copy(which.begin(), which.end(), with.begin()); }
    };
    // Roots are only taken of the best.
    struct Candidate {
        glm::dvec3 centre = glm::dvec3(0);
        double squared_radius = -1; // negative: none
    };
    struct Best {
        bool found = false;
        Candidate sphere;
        std::array<int, 3> with{-1, -1, -1};
    };

    glm::dvec3 at(int i) const { return points_[static_cast<std::size_t>(i)]; }

    void consider(Best& best, const Candidate& sphere, const Subset& subset) const {
        if (!(sphere.squared_radius >= 0) || (best.found && sphere.squared_radius >= best.sphere.squared_radius)) return;
        const double limit = sphere.squared_radius * (1 + 2 * containment_slack);
        for (int i = 0; i < count_; ++i) {
            if (i == subset.with[0] || i == subset.with[1] || i == subset.with[2]) continue;
            if (!(squared(at(i) - sphere.centre) <= limit)) return;
        }
        best = {true, sphere, subset.with};
    }

    // The smallest spheres with three and with four points on them.
    static Candidate around(glm::dvec3 p, glm::dvec3 q, glm::dvec3 r) {
        const glm::dvec3 a = q - p, b = r - p, normal = glm::cross(a, b);
        const double aa = squared(a), bb = squared(b), flat = squared(normal);
        if (!(flat > least_flatness * aa * bb)) return {};
        const glm::dvec3 offset = glm::cross(aa * b - bb * a, normal) / (2 * flat);
        return {p + offset, squared(offset)};
    }
    static Candidate around(glm::dvec3 p, glm::dvec3 q, glm::dvec3 r, glm::dvec3 s) {
        const glm::dvec3 a = q - p, b = r - p, c = s - p, bc = glm::cross(b, c);
        const double aa = squared(a), bb = squared(b), cc = squared(c), volume = glm::dot(a, bc);
        if (!(volume * volume > least_flatness * aa * bb * cc)) return {};
        const glm::dvec3 offset = (aa * bc + bb * glm::cross(c, a) + cc * glm::cross(a, b)) / (2 * volume);
        return {p + offset, squared(offset)};
    }

    std::array<glm::dvec3, 4> points_;
    int count_ = 0;
    DSphere sphere_;
};

struct Farthest {
    DSphere ball;
    double reach; // from the centre to the ball's far side
};

// Points and balls as one list of balls, relative to the first.
class Balls {
public:
    Balls(std::span<const glm::dvec3> points, std::span<const DSphere> spheres)
        : points_(points), spheres_(spheres), origin_(points.empty() ? spheres[0].centre : points[0]) {}

    glm::dvec3 origin() const { return origin_; }
    DSphere first() const { return {glm::dvec3(0), points_.empty() ? spheres_[0].radius : 0}; }

    Farthest farthest(glm::dvec3 from) const {
        const glm::dvec3 centre = from + origin_;
        double largest = -1;
        const glm::dvec3* point = nullptr;
        for (const glm::dvec3& p : points_) {
            const double d = squared(p - centre);
            if (d > largest) {
                largest = d;
                point = &p;
            }
        }
        Farthest out{{point ? *point - origin_ : glm::dvec3(0), 0}, point ? std::sqrt(largest) : -1};
        for (const DSphere& s : spheres_) {
            const double reach = glm::distance(s.centre, centre) + s.radius;
            if (s.radius >= 0 && reach > out.reach) out = {{s.centre - origin_, s.radius}, reach};
        }
        return out;
    }

private:
    std::span<const glm::dvec3> points_;
    std::span<const DSphere> spheres_;
    glm::dvec3 origin_;
};

// Points that somebody else keeps, relative to one of them.
class FarPoints {
public:
    FarPoints(glm::dvec3 origin, FunctionRef<glm::dvec3(glm::dvec3)> farthest) : origin_(origin), farthest_(farthest) {}

    DSphere first() const { return {glm::dvec3(0), 0}; }
    Farthest farthest(glm::dvec3 from) const {
        const glm::dvec3 centre = from + origin_, point = farthest_(centre);
        return {{point - origin_, 0}, glm::distance(point, centre)};
    }

private:
    glm::dvec3 origin_;
    FunctionRef<glm::dvec3(glm::dvec3)> farthest_;
};

// Grows a basis by what sticks out farthest until nothing does by more than `slack`, a share of the radius. For balls the
// points of the basis are cutting planes: their smallest sphere is never larger than the one looked for.
template <class AnyBalls>
DSphere grow_basis(AnyBalls& balls, double slack) {
    // A pair far apart is a good beginning.
    const DSphere one = balls.farthest(balls.first().centre).ball;
    const DSphere other = balls.farthest(one.centre).ball;
    Basis basis(one, other);
    for (int round = 0;; ++round) {
        const DSphere& sphere = basis.sphere();
        const auto [ball, reach] = balls.farthest(sphere.centre);
        if (reach <= sphere.radius * (1 + slack) || round == most_rounds)
            return {sphere.centre, std::max(sphere.radius, reach)};
        basis.add(ball);
    }
}

DSphere enclose(std::span<const glm::dvec3> points, std::span<const DSphere> spheres, double slack) {
    while (!spheres.empty() && spheres.front().radius < 0) spheres = spheres.subspan(1);
    if (points.empty() && spheres.empty()) return {};
    Balls balls(points, spheres);
    const DSphere sphere = grow_basis(balls, slack);
    return {sphere.centre + balls.origin(), sphere.radius};
}

// A point's distance loses a few units in the last place.
constexpr double exact_slack = 1e-13;
// What enclosing_sphere() may exceed the smallest radius by.
constexpr double sphere_slack = 1e-4;

} // namespace

DSphere smallest_sphere(std::span<const glm::dvec3> points) { return enclose(points, {}, exact_slack); }

DSphere smallest_sphere(glm::dvec3 first, FunctionRef<glm::dvec3(glm::dvec3)> farthest) {
    FarPoints points(first, farthest);
    const DSphere sphere = grow_basis(points, exact_slack);
    return {sphere.centre + first, sphere.radius};
}

DSphere enclosing_sphere(std::span<const glm::dvec3> points, std::span<const DSphere> spheres) {
    return enclose(points, spheres, sphere_slack);
}

// ---- several at once

namespace {

constexpr std::size_t lanes = BallLanes::lanes;

// Of each lane, the first of the points that are farthest from `from`.
[[gnu::always_inline]] inline void find_in(std::span<const BallLanes::Row> rows, const BallLanes::Row& from, BallLanes::FarthestPoints& out) {
    // Four numbers at a time (an extension that GCC and Clang share).
    constexpr std::size_t width = 4;
    using Doubles = double __attribute__((vector_size(8 * width)));
    using Integers = std::int64_t __attribute__((vector_size(8 * width)));
    for (std::size_t first = 0; first < lanes; first += width) {
        Doubles centre_x, centre_y, centre_z, x, y, z, farthest = {-1, -1, -1, -1};
        std::memcpy(&centre_x, &from.x[first], sizeof x);
        std::memcpy(&centre_y, &from.y[first], sizeof y);
        std::memcpy(&centre_z, &from.z[first], sizeof z);
        Integers number = {}, found = {};
        for (const BallLanes::Row& row : rows) {
            std::memcpy(&x, &row.x[first], sizeof x);
            std::memcpy(&y, &row.y[first], sizeof y);
            std::memcpy(&z, &row.z[first], sizeof z);
            x -= centre_x, y -= centre_y, z -= centre_z;
            const Doubles squared = x * x + y * y + z * z;
            const Integers is_farther = squared > farthest;
            farthest = is_farther ? squared : farthest;
            found = is_farther ? number : found;
            number += 1;
        }
        std::memcpy(&out.squared[first], &farthest, sizeof farthest);
        std::memcpy(&out.row[first], &found, sizeof found);
    }
}

using FindFarthestPoints = void(std::span<const BallLanes::Row> rows, const BallLanes::Row& from, BallLanes::FarthestPoints& out);
void find_with_any(std::span<const BallLanes::Row> rows, const BallLanes::Row& from, BallLanes::FarthestPoints& out) { find_in(rows, from, out); }

// Neither has fused operations, so both give the same bits.
#if defined(__x86_64__) && defined(__GNUC__)

[[gnu::target("avx2")]] void find_with_avx2(std::span<const BallLanes::Row> rows, const BallLanes::Row& from, BallLanes::FarthestPoints& out) {
    find_in(rows, from, out);
}
FindFarthestPoints* const find_farthest_points = __builtin_cpu_supports("avx2") ? find_with_avx2 : find_with_any;

#else

FindFarthestPoints* const find_farthest_points = find_with_any;

#endif

} // namespace

void BallLanes::find_points() {
    find_farthest_points(std::span(rows_).first(row_count_), from_, farthest_);
}

DSphere BallLanes::farthest(std::size_t lane) const {
    DSphere out{rows_[static_cast<std::size_t>(farthest_.row[lane])].at(lane), 0};
    if (spheres_[lane].empty()) return out;
    double most = std::sqrt(farthest_.squared[lane]);
    for (const DSphere& s : spheres_[lane]) {
        const double reach = glm::distance(s.centre, from_.at(lane)) + s.radius;
        if (reach > most) most = reach, out = s;
    }
    return out;
}

double BallLanes::reach(std::size_t lane) const {
    double most = std::sqrt(farthest_.squared[lane]);
    for (const DSphere& s : spheres_[lane]) most = std::max(most, glm::distance(s.centre, from_.at(lane)) + s.radius);
    return most;
}

bool BallLanes::sticks_out(std::size_t lane, double radius) const {
    if (farthest_.squared[lane] > radius * radius) return true;
    const auto sticks_out = [&](const DSphere& s) { return glm::distance(s.centre, from_.at(lane)) + s.radius > radius; };
    return std::any_of(spheres_[lane].begin(), spheres_[lane].end(), sticks_out);
}

void BallLanes::enclose(double slack, std::span<Sphere> out) {
    const std::size_t used = out.size();
    row_count_ = *std::max_element(counts_.begin(), counts_.begin() + static_cast<std::ptrdiff_t>(used));
    for (std::size_t lane = 0; lane < used; ++lane)
        for (std::size_t i = counts_[lane]; i < row_count_; ++i) rows_[i].put(lane, glm::dvec3(0));

    // As grow_basis() does.
    std::array<DSphere, lanes> one;
    std::array<Basis, lanes> bases;
    from_ = {};
    find_points();
    for (std::size_t lane = 0; lane < used; ++lane) one[lane] = farthest(lane);
    for (std::size_t lane = 0; lane < used; ++lane) from_.put(lane, one[lane].centre);
    find_points();
    for (std::size_t lane = 0; lane < used; ++lane) {
        bases[lane] = Basis(one[lane], farthest(lane));
        from_.put(lane, bases[lane].sphere().centre);
    }
    unsigned growing = (1u << used) - 1;
    for (int round = 0; growing != 0 && round < most_rounds; ++round) {
        find_points();
        for (unsigned rest = growing; rest != 0; rest &= rest - 1) {
            const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
            Basis& basis = bases[lane];
            if (sticks_out(lane, basis.sphere().radius * (1 + slack))) {
                basis.add(farthest(lane));
                from_.put(lane, basis.sphere().centre);
            } else {
                growing &= ~(1u << lane);
            }
        }
    }

    for (std::size_t lane = 0; lane < used; ++lane) {
        out[lane].centre = glm::vec3(from_.at(lane) + origins_[lane]);
        from_.put(lane, glm::dvec3(out[lane].centre) - origins_[lane]);
    }
    find_points();
    for (std::size_t lane = 0; lane < used; ++lane) out[lane].radius = round_up(reach(lane));
}

float round_up(double distance) {
    if (distance == 0) return 0;
    // Doubles carry distances and sums of the containment test; a few units in their last place cover them.
    const double needed = distance * (1 + 8 * std::numeric_limits<double>::epsilon());
    const float out = static_cast<float>(needed);
    // The next float, if need be; of the largest, infinity.
    return static_cast<double>(out) < needed ? std::bit_cast<float>(std::bit_cast<std::uint32_t>(out) + 1) : out;
}

Sphere round_outward(const DSphere& sphere) {
    if (sphere.radius < 0) return {};
    Sphere out;
    out.centre = glm::vec3(sphere.centre);
    out.radius = round_up(sphere.radius + glm::distance(glm::dvec3(out.centre), sphere.centre));
    return out;
}

} // namespace unseen::vdtree
