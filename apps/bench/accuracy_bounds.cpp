// What nodes are bounded by: spheres around points, and what tells which way triangles face. What the program has not is
// here as a twin.
#include "accuracy_axes.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <span>
#include <utility>

#include <glm/geometric.hpp>

#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/normal_mask.h>
#include <unseen/vdtree/vertex_tree.h>

#include "bench_tools.h"
#include "build/bounding_sphere.h" // vdtree's own
#include "exact_sphere.h"
#include "terminal.h"

namespace unseen::app {
namespace {

using vdtree::DSphere;
using vdtree::Facing;
using vdtree::Index;
using vdtree::NodeId;

// Interior nodes at equal steps through the tree that f(node) takes, about so many.
std::vector<NodeId> some_nodes(const vdtree::VertexTree& tree, std::size_t count,
                               const std::function<bool(NodeId)>& takes) {
    std::vector<NodeId> all;
    for (NodeId node = 0; node < tree.interior_count(); ++node)
        if (takes(node)) all.push_back(node);
    std::vector<NodeId> some;
    const std::size_t step = std::max<std::size_t>(all.size() / std::max<std::size_t>(count, 1), 1);
    for (std::size_t i = 0; i < all.size(); i += step) some.push_back(all[i]);
    return some;
}

// ---- spheres

DSphere around_centroid(std::span<const glm::dvec3> points) {
    DSphere sphere{glm::dvec3(0), 0};
    for (const glm::dvec3& p : points) sphere.centre += p;
    sphere.centre /= static_cast<double>(points.size());
    for (const glm::dvec3& p : points) sphere.radius = std::max(sphere.radius, glm::distance(p, sphere.centre));
    return sphere;
}

const glm::dvec3& farthest_from(glm::dvec3 from, std::span<const glm::dvec3> points) {
    return *std::ranges::max_element(points, {}, [&](const glm::dvec3& p) { return glm::dot(p - from, p - from); });
}

// Ritter 1990: from two points far apart, grown by each that is outside.
DSphere by_ritter(std::span<const glm::dvec3> points) {
    const glm::dvec3 a = farthest_from(points[0], points), b = farthest_from(a, points);
    DSphere sphere{0.5 * (a + b), 0.5 * glm::distance(a, b)};
    for (const glm::dvec3& p : points) {
        const double away = glm::distance(p, sphere.centre);
        if (away <= sphere.radius) continue;
        const double radius = 0.5 * (sphere.radius + away);
        sphere.centre += (p - sphere.centre) * ((away - radius) / away);
        sphere.radius = radius;
    }
    return sphere;
}

// ---- facing

// The triangles around a node's support, by the full mesh: unit normals, and a corner of each.
struct Ring {
    std::vector<glm::dvec3> normals, corners;
    vdtree::Sphere sphere; // that has a point of each triangle
};

class Rings {
public:
    explicit Rings(const vdtree::SoundTree& tree) : tree_(tree), start_(tree.leaf_count() + 1) {
        for (const vdtree::Triangle& t : tree.triangles())
            for (const Index leaf : t) ++start_[leaf + 1];
        for (std::size_t i = 1; i < start_.size(); ++i) start_[i] += start_[i - 1];
        std::vector<std::size_t> next(start_.begin(), start_.end() - 1);
        around_.resize(start_.back());
        for (Index t = 0; t < tree.triangle_count(); ++t)
            for (const Index leaf : tree.triangles()[t]) around_[next[leaf]++] = t;
    }

    Ring of(NodeId node) const {
        std::vector<Index> triangles(around_.begin() + static_cast<std::ptrdiff_t>(start_[tree_.first_leaf()[node]]),
                                     around_.begin() + static_cast<std::ptrdiff_t>(start_[tree_.leaf_end()[node]]));
        std::ranges::sort(triangles);
        triangles.erase(std::ranges::unique(triangles).begin(), triangles.end());
        Ring ring;
        ring.sphere = tree_.bounds()[node].ring;
        for (const Index t : triangles) {
            const auto corner = [&](std::size_t k) {
                return glm::dvec3(tree_.positions()[tree_.interior_count() + tree_.triangles()[t][k]]);
            };
            const glm::dvec3 n = glm::cross(corner(1) - corner(0), corner(2) - corner(0));
            const double length = glm::length(n);
            if (!(length > 0)) continue; // faces nowhere
            ring.normals.push_back(n / length);
            ring.corners.push_back(corner(0));
        }
        return ring;
    }

private:
    const vdtree::SoundTree& tree_;
    std::vector<std::size_t> start_;
    std::vector<Index> around_;
};

Facing of_two(bool some_front, bool some_back) {
    return some_front && some_back ? Facing::mixed
           : some_front            ? Facing::front
           : some_back             ? Facing::back
                                   : Facing::none;
}

// An eye as the tests of nodes take it.
struct Sight {
    glm::dvec3 eye;
    glm::vec3 to_eye; // from the sphere's centre, of length 1
    float distance;   // from there
    float radius;

    Sight(const glm::dvec3& from, const vdtree::Sphere& sphere) : eye(from), radius(sphere.radius) {
        const glm::dvec3 away = from - glm::dvec3(sphere.centre);
        distance = static_cast<float>(glm::length(away));
        to_eye = glm::vec3(glm::normalize(away));
    }
};

Facing facing_exactly(const Ring& ring, const Sight& sight) {
    bool some_front = false, some_back = false;
    for (std::size_t i = 0; i < ring.normals.size(); ++i) {
        const double towards = glm::dot(ring.normals[i], sight.eye - ring.corners[i]);
        some_front |= towards > 0;
        some_back |= towards < 0;
        if (some_front && some_back) return Facing::mixed;
    }
    return of_two(some_front, some_back);
}

// Covers what floats lose of unit vectors and their products.
constexpr float facing_margin = 1e-5f;

// Cells of equal angle, so many along each side of a cube's faces; one bit each. With 8 it is vdtree::NormalMask.
class MaskTwin {
public:
    explicit MaskTwin(int side) : side_(side) {
        for (int face = 0; face < 6; ++face)
            for (int row = 0; row < side; ++row)
                for (int column = 0; column < side; ++column) {
                    vdtree::NormalCell cell;
                    for (int k = 0; k < 4; ++k) {
                        glm::dvec3 p;
                        p[face / 2] = face % 2 ? -1 : 1;
                        p[(face / 2 + 1) % 3] = border(column + k % 2);
                        p[(face / 2 + 2) % 3] = border(row + k / 2);
                        const glm::vec3 n(glm::normalize(p));
                        const auto corner = static_cast<std::size_t>(k);
                        cell.x[corner] = n.x, cell.y[corner] = n.y, cell.z[corner] = n.z;
                    }
                    cells_.push_back(cell);
                }
    }

    using Bits = std::vector<std::uint64_t>;
    Bits mask(const Ring& ring) const {
        Bits bits((cells_.size() + 63) / 64);
        for (const glm::dvec3& n : ring.normals) {
            const std::size_t cell = cell_of_normal(n);
            bits[cell / 64] |= std::uint64_t{1} << (cell % 64);
        }
        return bits;
    }
    Facing facing_of(const Bits& bits, const Sight& sight) const {
        if (!(sight.distance > sight.radius)) return Facing::mixed;
        const float limit = sight.radius / sight.distance + facing_margin;
        bool some_front = false, some_back = false;
        for (std::size_t word = 0; word < bits.size(); ++word)
            for (std::uint64_t left = bits[word]; left; left &= left - 1) {
                const vdtree::NormalCell& cell = cells_[word * 64 + static_cast<std::size_t>(std::countr_zero(left))];
                float lowest = 2, highest = -2;
                for (std::size_t k = 0; k < 4; ++k) {
                    const float towards =
                        cell.x[k] * sight.to_eye.x + cell.y[k] * sight.to_eye.y + cell.z[k] * sight.to_eye.z;
                    lowest = std::min(lowest, towards), highest = std::max(highest, towards);
                }
                if (lowest > limit) some_front = true;
                else if (highest < -limit) some_back = true;
                else return Facing::mixed;
                if (some_front && some_back) return Facing::mixed;
            }
        return of_two(some_front, some_back);
    }
    double bytes() const { return static_cast<double>(cells_.size()) / 8; }

private:
    double border(int k) const { return std::tan((2.0 * k / side_ - 1) * std::numbers::pi / 4); }
    // Of a unit vector. What is at a border belongs to the cell that it is nearer to the middle of, within rounding.
    std::size_t cell_of_normal(glm::dvec3 n) const {
        const glm::dvec3 size = glm::abs(n);
        const int axis = size.x >= size.y ? (size.x >= size.z ? 0 : 2) : (size.y >= size.z ? 1 : 2);
        const auto index = [&](double along) {
            const double warped = std::atan(along / size[axis]) / (std::numbers::pi / 4);
            return std::clamp(static_cast<int>((warped + 1) / 2 * side_), 0, side_ - 1);
        };
        const int face = 2 * axis + (n[axis] < 0 ? 1 : 0);
        return static_cast<std::size_t>((face * side_ + index(n[(axis + 2) % 3])) * side_ + index(n[(axis + 1) % 3]));
    }

    int side_;
    std::vector<vdtree::NormalCell> cells_;
};

// All normals within an angle of an axis (Shirman and Abi-Ezzi 1993).
struct Cone {
    glm::vec3 axis = glm::vec3(0);
    float sine = 1, cosine = 0; // of the angle; wide ones tell nothing
    bool is_wide = true, is_empty = false;

    explicit Cone(const Ring& ring) : is_empty(ring.normals.empty()) {
        if (is_empty) return;
        // The middle of the smallest sphere around the normals' ends is the axis of the smallest cone.
        const DSphere around = vdtree::smallest_sphere(ring.normals);
        const double length = glm::length(around.centre);
        if (!(length > 1e-6)) return; // normals all around
        const glm::dvec3 middle = around.centre / length;
        double least = 1;
        for (const glm::dvec3& n : ring.normals) least = std::min(least, glm::dot(n, middle));
        if (!(least > 0)) return; // an angle of 90 degrees or more
        axis = glm::vec3(middle);
        cosine = static_cast<float>(least), sine = static_cast<float>(std::sqrt(std::max(0.0, 1 - least * least)));
        is_wide = false;
    }
    Facing facing_of(const Sight& sight) const {
        if (is_empty) return Facing::none;
        if (is_wide || !(sight.distance > sight.radius)) return Facing::mixed;
        // A normal n of the cone has n . e >= cos(a + b) for a the cone's angle and b the axis' to e.
        const float along = glm::dot(axis, sight.to_eye), across = std::sqrt(std::max(0.0f, 1 - along * along));
        const float limit = sight.radius / sight.distance + facing_margin;
        if (along > sine && along * cosine - across * sine > limit) return Facing::front;
        if (-along > sine && -along * cosine - across * sine > limit) return Facing::back;
        return Facing::mixed;
    }
};

} // namespace

Result<AccuracyPoints> sphere_points(AccuracySubject& subject, const AccuracyBenchOptions& options) {
    const auto sound = vdtree::SoundTree::of(subject.session.tree());
    if (!sound) return sound.error();
    const vdtree::SoundTree& tree = *sound;
    // Of fewer points all spheres are alike; more points take exact arithmetic too long.
    constexpr Index fewest = 5, most = 1000;
    const std::vector<NodeId> nodes = some_nodes(tree, options.nodes, [&](NodeId node) {
        const Index leaves = tree.leaf_end()[node] - tree.first_leaf()[node];
        return leaves >= fewest && leaves <= most && tree.support_spheres()[node].radius > 0;
    });
    if (nodes.empty()) return AccuracyPoints();
    std::vector<std::vector<glm::dvec3>> sets;
    std::size_t points_in_all = 0;
    for (const NodeId node : nodes) {
        std::vector<glm::dvec3>& set = sets.emplace_back();
        for (Index leaf = tree.first_leaf()[node]; leaf < tree.leaf_end()[node]; ++leaf)
            set.emplace_back(tree.positions()[tree.interior_count() + leaf]);
        points_in_all += set.size();
    }
    std::vector<double> radii(nodes.size()); // the smallest ones
    AccuracyPoints points;
    const auto add = [&](const std::string& name, double us, const std::vector<DSphere>& spheres,
                         const std::string& note, bool is_default) {
        double sum = 0, largest = 0, outside = 0;
        for (std::size_t i = 0; i < spheres.size(); ++i) {
            const double beyond = std::max(spheres[i].radius / radii[i] - 1, 0.0); // less is what rounding leaves
            sum += beyond;
            largest = std::max(largest, beyond);
            for (const glm::dvec3& p : sets[i])
                outside =
                    std::max(outside, glm::distance(p, spheres[i].centre) / radii[i] - spheres[i].radius / radii[i]);
        }
        points.push_back({.name = name,
                          .values = {us, sum / static_cast<double>(spheres.size()), largest, outside},
                          .note = note,
                          .is_default = is_default});
    };
    const auto us_since = [&](BenchClock::time_point start) {
        return 1e6 * seconds_since(start) / static_cast<double>(nodes.size());
    };
    const auto make = [&](const std::function<DSphere(std::span<const glm::dvec3>)>& around, double& us) {
        std::vector<double> times;
        std::vector<DSphere> spheres(sets.size());
        for (int k = 0; k < std::max(1, options.repeats / 3); ++k) {
            const auto start = BenchClock::now();
            for (std::size_t i = 0; i < sets.size(); ++i) spheres[i] = around(sets[i]);
            times.push_back(us_since(start));
        }
        us = median(std::move(times));
        return spheres;
    };
    double us = 0;
    const auto smallest = make([](auto set) { return vdtree::smallest_sphere(set); }, us);
    const double smallest_us = us;
    for (std::size_t i = 0; i < nodes.size(); ++i) radii[i] = smallest[i].radius;
    std::vector<DSphere> exact;
    if (has_exact_spheres()) {
        const auto start = BenchClock::now();
        for (const auto& set : sets) exact.push_back(exact_sphere(set));
        us = us_since(start);
        for (std::size_t i = 0; i < nodes.size(); ++i) radii[i] = exact[i].radius;
    }
    const double exact_us = us;
    const std::string size = std::to_string(nodes.size()) + " nodes, " + std::to_string(points_in_all / nodes.size()) +
                             " points on the average";
    const auto centroid = make(around_centroid, us);
    add("around the centroid", us, centroid, size, false);
    const auto ritter = make(by_ritter, us);
    add("Ritter", us, ritter, "", false);
    add("Welzl, of points", smallest_us, smallest, "", false);
    if (!exact.empty()) add("CGAL, exact", exact_us, exact, "", false);
    else points.back().note = "taken as exact, for this build has no CGAL";

    // As the builder does it: of children's spheres, several nodes at a time, and rounded outward to floats.
    constexpr double slack = 1e-3; // node_slack of bound_spheres.cpp
    constexpr std::size_t lanes = vdtree::BallLanes::lanes;
    vdtree::BallLanes balls;
    std::array<vdtree::Sphere, lanes> out;
    const auto start = BenchClock::now();
    for (std::size_t i = 0; i < nodes.size(); i += lanes) {
        const std::size_t used = std::min(lanes, nodes.size() - i);
        for (std::size_t lane = 0; lane < used; ++lane) {
            balls.begin(lane, tree.positions()[nodes[i + lane]]);
            tree.for_each_child(nodes[i + lane], [&](NodeId child) {
                if (tree.is_leaf(child)) balls.add(lane, tree.positions()[child]);
                else balls.add(lane, tree.support_spheres()[child]);
            });
        }
        balls.enclose(slack, std::span(out).first(used));
    }
    us = us_since(start);
    std::vector<DSphere> own;
    for (const NodeId node : nodes) {
        const vdtree::Sphere& s = tree.support_spheres()[node];
        own.push_back({glm::dvec3(s.centre), static_cast<double>(s.radius)});
    }
    add("the program's, of children's spheres", us, own,
        "has the children's spheres and all proxies in it, too, so that tests nest", true);
    return points;
}

Result<AccuracyPoints> facing_points(AccuracySubject& subject, const AccuracyBenchOptions& options) {
    const auto sound = vdtree::SoundTree::of(subject.session.tree());
    if (!sound) return sound.error();
    const vdtree::SoundTree& tree = *sound;
    constexpr Index most_leaves = 64; // larger nodes are silhouettes from nearly everywhere
    const std::vector<NodeId> nodes = some_nodes(tree, options.nodes, [&](NodeId node) {
        const bool moves = tree.support_spheres()[node].radius > 0; // else the fold changes nothing, and none asks
        return moves && tree.leaf_end()[node] - tree.first_leaf()[node] <= most_leaves;
    });
    if (nodes.empty()) return AccuracyPoints();
    const Rings around(tree);
    std::vector<Ring> rings;
    for (const NodeId node : nodes) rings.push_back(around.of(node));
    // Eyes all around, as far away as the view's.
    constexpr int eyes = 12;
    const vdtree::Similarity& placement = subject.session.scene().objects[0].placement;
    std::vector<std::vector<Sight>> sights(nodes.size());
    for (int i = 0; i < eyes; ++i) {
        vdtree::View view = vdtree::orbited(subject.view, 360.0 * i / eyes);
        view.eye.y += (i % 3 - 1) * 0.4 * glm::distance(view.eye, view.target); // from above, and from below
        const glm::dvec3 eye = vdtree::eye_in_tree(tree, view, placement);
        for (std::size_t k = 0; k < nodes.size(); ++k) sights[k].emplace_back(eye, rings[k].sphere);
    }
    const double tests = static_cast<double>(eyes) * static_cast<double>(nodes.size());
    std::vector<std::vector<Facing>> truth(nodes.size());
    std::size_t one_sided = 0;
    for (std::size_t k = 0; k < nodes.size(); ++k)
        for (const Sight& sight : sights[k]) {
            truth[k].push_back(facing_exactly(rings[k], sight));
            one_sided += truth[k].back() != Facing::mixed;
        }
    AccuracyPoints points;
    const auto add = [&](const std::string& name, double bytes,
                         const std::function<Facing(std::size_t, const Sight&)>& test, const std::string& note,
                         bool is_default) {
        std::size_t false_silhouettes = 0, misses = 0;
        std::vector<double> times;
        for (int repeat = 0; repeat < std::max(1, options.repeats / 3); ++repeat) {
            false_silhouettes = misses = 0;
            const auto start = BenchClock::now();
            for (std::size_t k = 0; k < nodes.size(); ++k)
                for (std::size_t i = 0; i < sights[k].size(); ++i) {
                    const Facing found = test(k, sights[k][i]);
                    false_silhouettes += found == Facing::mixed && truth[k][i] != Facing::mixed;
                    misses += found != Facing::mixed && found != truth[k][i];
                }
            times.push_back(1e9 * seconds_since(start) / tests);
        }
        points.push_back({.name = name,
                          .values = {median(std::move(times)),
                                     static_cast<double>(false_silhouettes) /
                                         static_cast<double>(std::max<std::size_t>(one_sided, 1)),
                                     static_cast<double>(misses), bytes},
                          .note = note,
                          .is_default = is_default});
    };
    for (const int side : {2, 4, 8, 12, 16}) {
        const MaskTwin twin(side);
        std::vector<MaskTwin::Bits> masks;
        for (const Ring& ring : rings) masks.push_back(twin.mask(ring));
        const std::string name = "mask of 6 x " + std::to_string(side) + " x " + std::to_string(side);
        add(
            name, twin.bytes(), [&](std::size_t k, const Sight& s) { return twin.facing_of(masks[k], s); },
            side == 2 ? std::to_string(nodes.size()) + " nodes from " + std::to_string(eyes) + " eyes" : "", false);
    }
    std::vector<vdtree::NormalSlabs> slabs(nodes.size());
    std::vector<vdtree::NormalMask> masks(nodes.size());
    std::vector<Cone> cones;
    double triangles = 0;
    for (std::size_t k = 0; k < nodes.size(); ++k) {
        for (const glm::dvec3& n : rings[k].normals) {
            slabs[k].insert(n);
            masks[k].insert(vdtree::normal_cell(n));
        }
        cones.emplace_back(rings[k]);
        triangles += static_cast<double>(rings[k].normals.size()) / static_cast<double>(nodes.size());
    }
    add(
        "slabs", sizeof(vdtree::NormalSlabs),
        [&](std::size_t k, const Sight& s) { return facing(slabs[k], s.to_eye, s.distance, s.radius); }, "", false);
    add(
        "slabs, then mask of 6 x 8 x 8", sizeof(vdtree::NormalSlabs) + sizeof(vdtree::NormalMask),
        [&](std::size_t k, const Sight& s) { return facing(slabs[k], masks[k], s.to_eye, s.distance, s.radius); },
        "the program's; here one by one, cuts test many at once", true);
    add(
        "cone", 4 * sizeof(float), [&](std::size_t k, const Sight& s) { return cones[k].facing_of(s); },
        "a twin; cones around cones are wider than what they hold", false);
    add(
        "each triangle, exact", triangles * 2 * sizeof(glm::vec3),
        [&](std::size_t k, const Sight& s) { return facing_exactly(rings[k], s); },
        rounded(triangles, 3) + " triangles on the average", false);
    add(
        "the tree's own slabs and masks", sizeof(vdtree::NormalSlabs) + sizeof(vdtree::NormalMask),
        [&](std::size_t k, const Sight& s) {
            if (tree.bounds()[nodes[k]].flags & vdtree::irregular_ring) return Facing::mixed;
            return facing(
                tree.bounds()[nodes[k]].slabs, [&] { return tree.mask(nodes[k]); }, s.to_eye, s.distance, s.radius);
        },
        "of more triangles: one more ring, and what folds nearby make of them; borders are outlines from everywhere",
        false);
    return points;
}

} // namespace unseen::app
