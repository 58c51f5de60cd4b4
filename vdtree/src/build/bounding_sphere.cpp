#include "build/bounding_sphere.h"

#include <bit>
#include <limits>

#include <glm/geometric.hpp>

#ifdef __SSE2__
#include <immintrin.h>
#endif

#include <unseen/vdtree/internal/simd.h>

namespace unseen::vdtree {

namespace {

// A point counts as contained up to this share of the radius, so that rounding does not change the basis for ever.
constexpr double containment_slack = 1e-12;
// A basis stops growing after this many rounds, far more than needed; the radius then grows to contain everything.
constexpr int most_rounds = 64;
// Share of the product of lengths: flatter points have no meaningful circumsphere.
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
        } else if (distance + a.radius <= b.radius) {
            sphere_ = b;
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

    // Makes the smallest sphere around the basis and what of a ball is farthest outside of its sphere. For balls the
    // points of the basis are cutting planes: their smallest sphere is never larger than the one looked for.
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
            consider(best, {p + half, squared(half)}, {i, -1, -1});
        }
        // A pair's sphere that contains the others is the smallest, but one of more points need not be.
        if (!best.found) {
            for (int i = 0; i < count_; ++i)
                for (int j = i + 1; j < count_; ++j) consider(best, around(p, at(i), at(j)), {i, j, -1});
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
        for (const int i : best.with)
            if (i >= 0) kept[static_cast<std::size_t>(count++)] = at(i);
        kept[static_cast<std::size_t>(count++)] = p;
        points_ = kept;
        count_ = count;
        sphere_ = {best.sphere.centre, std::sqrt(best.sphere.squared_radius)};
    }

    using Subset = std::array<int, 3>; // of the points; -1: one less
    // Roots are only taken of the best.
    struct Candidate {
        glm::dvec3 centre = glm::dvec3(0);
        double squared_radius = -1; // negative: none
    };
    struct Best {
        bool found = false;
        Candidate sphere;
        Subset with{-1, -1, -1};
    };

    glm::dvec3 at(int i) const { return points_[static_cast<std::size_t>(i)]; }

    void consider(Best& best, const Candidate& sphere, const Subset& subset) const {
        if (!(sphere.squared_radius >= 0) || (best.found && sphere.squared_radius >= best.sphere.squared_radius))
            return;
        const double limit = sphere.squared_radius * (1 + 2 * containment_slack);
        for (int i = 0; i < count_; ++i) {
            if (std::ranges::find(subset, i) != subset.end()) continue;
            if (!(squared(at(i) - sphere.centre) <= limit)) return;
        }
        best = {true, sphere, subset};
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

} // namespace

DSphere smallest_sphere(std::span<const glm::dvec3> points) {
    if (points.empty()) return {};
    const auto farthest = [&](glm::dvec3 from) {
        glm::dvec3 point = points[0];
        double most = -1;
        for (const glm::dvec3& p : points) {
            const double here = squared(p - from);
            if (here > most) most = here, point = p;
        }
        return point;
    };
    constexpr double slack = 1e-13; // a point's distance loses a few units in the last place
    // Relative to the first point. A pair far apart is a good beginning.
    const glm::dvec3 first = points[0], one = farthest(first) - first, other = farthest(one + first) - first;
    Basis basis({one, 0}, {other, 0});
    for (int round = 0;; ++round) {
        const DSphere& sphere = basis.sphere();
        const glm::dvec3 centre = sphere.centre + first, point = farthest(centre);
        const double reach = glm::distance(point, centre);
        if (reach <= sphere.radius * (1 + slack) || round == most_rounds)
            return {centre, std::max(sphere.radius, reach)};
        basis.add({point - first, 0});
    }
}

// ---- several at once

namespace {

constexpr std::size_t lanes = BallLanes::lanes;
using Lane = BallLanes::Lane;
using Row = BallLanes::Row;
using BallRow = BallLanes::BallRow;

// The sets of all lanes. Those that lack a sphere have one that reaches nowhere.
struct Sets {
    std::span<const Row> points;
    std::span<const BallRow> spheres;
};

// The ball of each lane that reaches farthest from a place.
struct FarthestOfLanes {
    BallRow ball;      // the first point of those that are farthest, or a sphere that reaches farther
    Lane squared;      // the distance of that point
    Lane sphere_reach; // to the farthest far side of a sphere; negative: there is none
    Lane reach;

    bool sticks_out(std::size_t lane, double radius) const {
        return squared[lane] > radius * radius || sphere_reach[lane] > radius;
    }
};

// `width` lanes at a time: as many as the processor's registers hold (an extension that GCC and Clang share).
template <std::size_t width>
struct Kernel {
    // GCC 12 overlooks such attributes in `using`.
    typedef double Doubles __attribute__((vector_size(8 * width)));
    typedef std::int64_t Masks __attribute__((vector_size(8 * width)));
    static_assert(sizeof(Doubles) == 8 * width && sizeof(Masks) == 8 * width);

    UNSEEN_INLINE static Doubles load(const Lane& from, std::size_t first) {
        Doubles out;
        std::memcpy(&out, &from[first], sizeof out);
        return out;
    }
    UNSEEN_INLINE static void store(Doubles v, Lane& to, std::size_t first) { std::memcpy(&to[first], &v, sizeof v); }
    UNSEEN_INLINE static Doubles root(Doubles v) {
#ifdef __SSE2__
        __m128d pairs[width / 2];
        std::memcpy(pairs, &v, sizeof v);
        for (__m128d& pair : pairs) pair = _mm_sqrt_pd(pair);
        std::memcpy(&v, pairs, sizeof v);
#else
        for (std::size_t i = 0; i < width; ++i) v[i] = std::sqrt(v[i]);
#endif
        return v;
    }

    struct Points {
        Doubles x, y, z;

        UNSEEN_INLINE friend Points operator-(Points a, Points b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
    };
    UNSEEN_INLINE static Doubles squared(Points v) { return v.x * v.x + v.y * v.y + v.z * v.z; }
    UNSEEN_INLINE static Points choose(Masks which, Points a, Points b) {
        return {which ? a.x : b.x, which ? a.y : b.y, which ? a.z : b.z};
    }
    UNSEEN_INLINE static Points load(const Row& row, std::size_t first) {
        return {load(row.x, first), load(row.y, first), load(row.z, first)};
    }
    UNSEEN_INLINE static void find_farthest(const Sets& sets, const Row& from, FarthestOfLanes& out) {
        for (std::size_t first = 0; first < lanes; first += width) {
            const Points start = load(from, first);
            Points centre{};
            Doubles of_ball{}, distance = Doubles{} - 1, sphere_reach = distance;
            for (const Row& row : sets.points) {
                const Points p = load(row, first);
                const Doubles here = squared(p - start);
                centre = choose(here > distance, p, centre);
                distance = here > distance ? here : distance;
            }
            Doubles reach = root(distance);
            for (const BallRow& row : sets.spheres) {
                const Points p = load(row, first);
                const Doubles radius = load(row.radius, first), here = root(squared(p - start)) + radius;
                sphere_reach = here > sphere_reach ? here : sphere_reach;
                const Masks farther = here > reach;
                reach = farther ? here : reach;
                centre = choose(farther, p, centre);
                of_ball = farther ? radius : of_ball;
            }
            store(centre.x, out.ball.x, first), store(centre.y, out.ball.y, first), store(centre.z, out.ball.z, first);
            store(of_ball, out.ball.radius, first);
            store(distance, out.squared, first);
            store(sphere_reach, out.sphere_reach, first);
            store(reach, out.reach, first);
        }
    }
};

using FindFarthest = void(const Sets& sets, const Row& from, FarthestOfLanes& out);
void find_with_any(const Sets& sets, const Row& from, FarthestOfLanes& out) {
    Kernel<2>::find_farthest(sets, from, out);
}
// Neither has fused operations, so both give the same bits.
UNSEEN_AVX2 void find_with_avx2(const Sets& sets, const Row& from, FarthestOfLanes& out) {
    Kernel<4>::find_farthest(sets, from, out);
}
FindFarthest* const find = has_avx2() ? find_with_avx2 : find_with_any;

} // namespace

void BallLanes::fill_up(std::size_t used) {
    const auto end = static_cast<std::ptrdiff_t>(used);
    row_count_ = *std::max_element(counts_.begin(), counts_.begin() + end);
    sphere_count_ = *std::max_element(sphere_counts_.begin(), sphere_counts_.begin() + end);
    for (std::size_t lane = 0; lane < used; ++lane) {
        for (std::size_t i = counts_[lane]; i < row_count_; ++i) rows_[i].put(lane, glm::dvec3(0));
        for (std::size_t i = sphere_counts_[lane]; i < sphere_count_; ++i)
            spheres_[i].put(lane, glm::dvec3(0), -std::numeric_limits<double>::infinity());
    }
}

void BallLanes::enclose(double slack, std::span<Sphere> out) {
    const std::size_t used = out.size();
    fill_up(used);
    const Sets sets{std::span(rows_).first(row_count_), std::span(spheres_).first(sphere_count_)};
    // A pair far apart is a good beginning, from each lane's first point, which is at 0.
    FarthestOfLanes one, far;
    Row from{};
    find(sets, from, one);
    from = one.ball;
    find(sets, from, far);
    std::array<Basis, lanes> bases;
    for (std::size_t lane = 0; lane < used; ++lane) {
        bases[lane] = Basis(one.ball.ball(lane), far.ball.ball(lane));
        from.put(lane, bases[lane].sphere().centre);
    }
    unsigned growing = (1u << used) - 1;
    for (int round = 0; growing != 0 && round < most_rounds; ++round) {
        find(sets, from, far);
        for (unsigned rest = growing; rest != 0; rest &= rest - 1) {
            const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
            Basis& basis = bases[lane];
            if (far.sticks_out(lane, basis.sphere().radius * (1 + slack))) {
                basis.add(far.ball.ball(lane));
                from.put(lane, basis.sphere().centre);
            } else {
                growing &= ~(1u << lane);
            }
        }
    }

    for (std::size_t lane = 0; lane < used; ++lane) {
        out[lane].centre = glm::vec3(from.at(lane) + origins_[lane]);
        from.put(lane, glm::dvec3(out[lane].centre) - origins_[lane]);
    }
    find(sets, from, far);
    for (std::size_t lane = 0; lane < used; ++lane) out[lane].radius = round_up(far.reach[lane]);
}

float round_up(double distance) {
    if (distance == 0) return 0;
    // Doubles carry distances and sums of the containment test; a few units in their last place cover them.
    const double needed = distance * (1 + 8 * std::numeric_limits<double>::epsilon());
    const float out = static_cast<float>(needed);
    // The next float, if need be; of the largest, infinity.
    return std::bit_cast<float>(std::bit_cast<std::uint32_t>(out) + (static_cast<double>(out) < needed ? 1u : 0u));
}

Sphere round_outward(const DSphere& sphere) {
    if (sphere.radius < 0) return {};
    Sphere out;
    out.centre = glm::vec3(sphere.centre);
    out.radius = round_up(sphere.radius + glm::distance(glm::dvec3(out.centre), sphere.centre));
    return out;
}

} // namespace unseen::vdtree
