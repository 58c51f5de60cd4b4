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
            const glm::dvec3 direction = apart / distance;
            points_[0] = a.centre - direction * a.radius;
            points_[1] = b.centre + direction * b.radius;
            sphere_ = {(points_[0] + points_[1]) * 0.5, (distance + a.radius + b.radius) * 0.5};
            count_ = 2;
        }
    }

    const DSphere& sphere() const { return sphere_; }

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

private:
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
    int count_;
    DSphere sphere_;
};

struct Farthest {
    DSphere ball;
    double reach; // from the centre to the ball's far side
};

// Four numbers at a time (an extension that GCC and Clang share).
using Floats = float __attribute__((vector_size(16)));
using Ints = int __attribute__((vector_size(16)));

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
        const glm::dvec3 away = ball.centre - sphere.centre;
        const double length = glm::length(away);
        const glm::dvec3 direction = length > 0 ? away / length : glm::dvec3(1, 0, 0);
        basis.add(ball.centre + direction * ball.radius);
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

namespace {

constexpr std::size_t lanes = 4;

Floats load(const std::vector<float>& v, std::size_t i) {
    Floats out;
    std::memcpy(&out, v.data() + i, sizeof out);
    return out;
}
void store(std::vector<float>& v, std::size_t i, Floats values) { std::memcpy(v.data() + i, &values, sizeof values); }
Floats larger(Floats a, Floats b) { return a > b ? a : b; }
float largest(Floats v) {
    const Floats two = larger(v, __builtin_shufflevector(v, v, 2, 3, 0, 1));
    return std::max(two[0], two[1]);
}

// Of the distance between two of the points: covers the rounding of their positions relative to each other, and of the distance, in
// floats: less than 8 times half a unit in the last place.
constexpr double float_slack = 1e-6;
// Squares below this, in units of the tree's extent, may have lost digits, or everything.
constexpr float least_square = 1e-30f;

} // namespace

// The view of a BallSet that a basis grows in: relative to the first point, scaled.
class BallSet::Scaled {
public:
    explicit Scaled(const BallSet& set) : set_(set) {}

    DSphere first() const { return {glm::dvec3(0), 0}; }

    // Measured from `from` rounded to floats. Of points nearly as far as each other, any one.
    Farthest farthest(glm::dvec3 from) {
        middle_ = glm::vec3(from);
        const glm::dvec3 centre(middle_);
        most_squared_ = 0;
        Farthest out{{glm::dvec3(0), 0}, -1};
        for (std::size_t begin = 0; begin < set_.count_; begin += block) look_at_block(begin, out);
        for (const DSphere& s : set_.scaled_spheres_) {
            const double reach = glm::distance(s.centre, centre) + s.radius;
            if (reach > out.reach) out = {s, reach};
        }
        return out;
    }

    // Of the last call: where it measured from, and the largest squared distance of a point.
    glm::vec3 middle() const { return middle_; }
    float most_squared() const { return most_squared_; }

private:
    // The last digits of the squared distances make room for the points' numbers: one comparison brings both.
    static constexpr std::size_t block = 64;
    static constexpr int number_bits = block - 1;
    void look_at_block(std::size_t begin, Farthest& out) {
        const auto& [x, y, z] = set_.relative_;
        const std::size_t end = std::min(begin + block, set_.count_);
        Ints number = {0, 1, 2, 3};
        Floats farthest = {0, 0, 0, 0}, largest_squares = {0, 0, 0, 0};
        for (std::size_t i = begin; i < end; i += lanes) {
            const Floats dx = load(x, i) - middle_.x, dy = load(y, i) - middle_.y, dz = load(z, i) - middle_.z;
            const Floats squared = dx * dx + dy * dy + dz * dz;
            largest_squares = larger(largest_squares, squared);
            const Ints numbered = (std::bit_cast<Ints>(squared) & ~number_bits) | number;
            farthest = larger(farthest, std::bit_cast<Floats>(numbered));
            number += static_cast<int>(lanes);
        }
        const float most = largest(largest_squares);
        if (most <= most_squared_ && out.reach >= 0) return;
        most_squared_ = most;
        const std::size_t i = begin + static_cast<std::size_t>(std::bit_cast<int>(largest(farthest)) & number_bits);
        const glm::dvec3 point(x[i], y[i], z[i]);
        out = {{point, 0}, most >= least_square ? std::sqrt(static_cast<double>(most)) : glm::distance(point, glm::dvec3(middle_))};
    }

    const BallSet& set_;
    glm::vec3 middle_{0};
    float most_squared_ = 0;
};

void BallSet::grow() {
    constexpr std::size_t least = 64;
    points_.resize(std::max(least, 2 * count_));
    for (auto& axis : relative_) axis.resize(points_.size());
}

// Those that are new, and what fills up the last vector: the first point again.
void BallSet::make_relative() {
    for (std::size_t i = count_; i % lanes != 0; ++i) points_[i] = points_[0];
    const Floats origin = points_[0];
    for (std::size_t i = relative_count_ / lanes * lanes; i < count_; i += lanes) {
        const Floats a = (points_[i] - origin) * scale_, b = (points_[i + 1] - origin) * scale_;
        const Floats c = (points_[i + 2] - origin) * scale_, d = (points_[i + 3] - origin) * scale_;
        const Floats low_ab = __builtin_shufflevector(a, b, 0, 4, 1, 5), low_cd = __builtin_shufflevector(c, d, 0, 4, 1, 5);
        const Floats high_ab = __builtin_shufflevector(a, b, 2, 6, 3, 7), high_cd = __builtin_shufflevector(c, d, 2, 6, 3, 7);
        store(relative_[0], i, __builtin_shufflevector(low_ab, low_cd, 0, 1, 4, 5));
        store(relative_[1], i, __builtin_shufflevector(low_ab, low_cd, 2, 3, 6, 7));
        store(relative_[2], i, __builtin_shufflevector(high_ab, high_cd, 0, 1, 4, 5));
    }
    relative_count_ = count_;
}

DSphere BallSet::enclose(double slack) {
    make_relative();
    const auto point = [&](std::size_t i) { return glm::dvec3(points_[i][0], points_[i][1], points_[i][2]); };
    const glm::dvec3 origin = point(0);
    const double scale = scale_;
    scaled_spheres_.clear();
    for (const Sphere& s : spheres_)
        scaled_spheres_.push_back({(glm::dvec3(s.centre) - origin) * scale, s.radius * scale});
    Scaled scaled(*this);
    grow_basis(scaled, slack); // the last that it asks for is the farthest from where it ends
    const glm::dvec3 centre = glm::dvec3(scaled.middle()) * (1 / scale) + origin;
    double reach = 0;
    if (const float squared = scaled.most_squared(); squared >= least_square) {
        reach = std::sqrt(static_cast<double>(squared)) * (1 + float_slack) * (1 / scale);
    } else {
        for (std::size_t i = 0; i < count_; ++i) reach = std::max(reach, glm::distance(point(i), centre));
    }
    for (const Sphere& s : spheres_) reach = std::max(reach, glm::distance(glm::dvec3(s.centre), centre) + s.radius);
    return {centre, reach};
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
