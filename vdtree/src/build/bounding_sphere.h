// Small enclosing spheres of points and of spheres.
#pragma once

#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

struct DSphere {
    glm::dvec3 centre = glm::dvec3(0);
    double radius = -1; // negative: contains nothing
};

// The smallest sphere that contains all points (Welzl 1991, move to front). Looks for the farthest from some place ten times
// or so. Deterministic.
DSphere smallest_sphere(std::span<const glm::dvec3> points);

// Several sets of points and spheres, each to be enclosed by a sphere of its own, at the same time: the farthest points
// of all are looked for together, and what takes long for one of them is done while others wait for it. Keeps its
// memory.
class BallLanes {
public:
    static constexpr std::size_t lanes = 8;

    // Begins a lane's set with a point, which the others are measured from.
    void begin(std::size_t lane, glm::vec3 point) {
        counts_[lane] = sphere_counts_[lane] = 0;
        origins_[lane] = glm::dvec3(point);
        add(lane, point);
    }
    void add(std::size_t lane, glm::vec3 point) {
        make_room(counts_[lane] + 1);
        rows_[counts_[lane]++].put(lane, glm::dvec3(point) - origins_[lane]);
    }
    void add(std::size_t lane, std::span<const glm::vec3> points, std::span<const Index> which) {
        std::size_t next = counts_[lane];
        counts_[lane] += which.size();
        make_room(counts_[lane]);
        Row* const rows = rows_.data();
        const glm::dvec3 origin = origins_[lane];
        for (const Index i : which) rows[next++].put(lane, glm::dvec3(points[i]) - origin);
    }
    void add(std::size_t lane, const Sphere& sphere) {
        const std::size_t next = sphere_counts_[lane]++;
        if (next == spheres_.size()) spheres_.resize(2 * next + 2);
        spheres_[next].put(lane, glm::dvec3(sphere.centre) - origins_[lane], static_cast<double>(sphere.radius));
    }
    void forget_spheres(std::size_t lane) { sphere_counts_[lane] = 0; }

    // For as many lanes as there are in `out`, from the first on: each sphere contains everything, and its radius
    // exceeds the smallest one by a relative `slack` at most, but for the rounding of the centre to floats.
    void enclose(double slack, std::span<Sphere> out);

    using Lane = std::array<double, lanes>; // a number of each lane

    // A point of each lane.
    struct alignas(64) Row {
        Lane x, y, z;

        void put(std::size_t lane, glm::dvec3 p) { x[lane] = p.x, y[lane] = p.y, z[lane] = p.z; }
        glm::dvec3 at(std::size_t lane) const { return {x[lane], y[lane], z[lane]}; }
    };
    // A ball of each lane.
    struct BallRow : Row {
        Lane radius;

        void put(std::size_t lane, glm::dvec3 p, double r) { Row::put(lane, p), radius[lane] = r; }
        DSphere ball(std::size_t lane) const { return {at(lane), radius[lane]}; }
    };

private:
    void make_room(std::size_t rows) {
        if (rows > rows_.size()) rows_.resize(2 * rows);
    }
    void fill_up(std::size_t used);

    std::size_t row_count_ = 0, sphere_count_ = 0; // of the rows, those that were filled up for all lanes
    std::vector<Row> rows_;                        // relative to the lanes' first points
    std::vector<BallRow> spheres_;                 // relative, too
    std::array<std::size_t, lanes> counts_{}, sphere_counts_{};
    std::array<glm::dvec3, lanes> origins_{};
};

// The sphere in floats, grown so that it contains the given one in exact arithmetic.
Sphere round_outward(const DSphere& sphere);
// A distance in floats that covers the given one and its rounding.
float round_up(double distance);

} // namespace unseen::vdtree
