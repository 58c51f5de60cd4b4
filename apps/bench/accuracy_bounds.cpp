// What nodes are bounded by: spheres around points, and what tells which way triangles face. What the program has not is
// here as a twin.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <numbers>
#include <span>
#include <utility>

#include <glm/geometric.hpp>

#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/internal/normal_mask.h>
#include <unseen/vdtree/vertex_tree.h>

#include "accuracy.h"
#include "build/bounding_sphere.h" // vdtree's own
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
        triangles.erase(std::unique(triangles.begin(), triangles.end()), triangles.end());
        Ring ring;
        ring.sphere = tree_.bounds()[node].ring;
        for (const Index t : triangles) {
            const auto corner = [&](std::size_t k) {
                return glm::dvec3(tree_.positions()[tree_.wedge_of_leaf(tree_.triangles()[t][k])]);
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
    // The cell of a unit vector. What is at a border belongs to the cell whose middle is nearer, within rounding.
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

// The leaves of some nodes.
class SphereSets {
public:
    SphereSets(const vdtree::SoundTree& tree, std::size_t nodes) : tree_(tree) {
        constexpr Index fewest = 5, most = 1000; // of fewer points all spheres are alike
        nodes_ = some_nodes(tree, nodes, [&](NodeId node) {
            const Index leaves = tree.leaf_end()[node] - tree.first_leaf()[node];
            return leaves >= fewest && leaves <= most && tree.support_spheres()[node].radius > 0;
        });
        for (const NodeId node : nodes_) {
            std::vector<glm::dvec3>& set = sets_.emplace_back();
            for (Index leaf = tree.first_leaf()[node]; leaf < tree.leaf_end()[node]; ++leaf)
                if (const NodeId place = tree.place_of_leaf(leaf); tree.wedge_of_leaf(leaf) == tree.first_wedge(place))
                    set.emplace_back(tree.position(place));
            points_in_all_ += set.size();
        }
    }

    bool empty() const { return nodes_.empty(); }
    std::string size() const {
        return std::to_string(nodes_.size()) + " nodes, " + std::to_string(points_in_all_ / nodes_.size()) +
               " points on the average";
    }

    struct Made {
        std::vector<DSphere> spheres;
        double us = 0; // a node
    };
    Made make(DSphere (*around)(std::span<const glm::dvec3>)) const {
        Made made{std::vector<DSphere>(sets_.size())};
        made.us = 1e6 / static_cast<double>(nodes_.size()) * median_seconds(few_repeats, [&] {
                      for (std::size_t i = 0; i < sets_.size(); ++i) made.spheres[i] = around(sets_[i]);
                  });
        return made;
    }

    // As the builder does it: of children's spheres, several nodes at a time, and rounded outward to floats.
    Made make_own() const {
        constexpr double slack = 1e-3; // node_slack of bound_spheres.cpp
        constexpr std::size_t lanes = vdtree::BallLanes::lanes;
        vdtree::BallLanes balls;
        std::array<vdtree::Sphere, lanes> out;
        const auto start = BenchClock::now();
        for (std::size_t i = 0; i < nodes_.size(); i += lanes) {
            const std::size_t used = std::min(lanes, nodes_.size() - i);
            for (std::size_t lane = 0; lane < used; ++lane) {
                balls.begin(lane, tree_.position(nodes_[i + lane]));
                tree_.for_each_child(nodes_[i + lane], [&](NodeId child) {
                    if (tree_.is_place(child)) balls.add(lane, tree_.position(child));
                    else balls.add(lane, tree_.support_spheres()[child]);
                });
            }
            balls.enclose(slack, std::span(out).first(used));
        }
        Made made{{}, 1e6 * seconds_since(start) / static_cast<double>(nodes_.size())};
        for (const NodeId node : nodes_) {
            const vdtree::Sphere& s = tree_.support_spheres()[node];
            made.spheres.push_back({glm::dvec3(s.centre), static_cast<double>(s.radius)});
        }
        return made;
    }

    // `smallest`: the exact radii.
    AccuracyPoint point(const std::string& name, const Made& made, const Made& smallest, const std::string& note = {},
                        bool is_default = false) const {
        double sum = 0, largest = 0, outside = 0;
        for (std::size_t i = 0; i < made.spheres.size(); ++i) {
            const DSphere& sphere = made.spheres[i];
            const double least = smallest.spheres[i].radius;
            const double beyond = std::max(sphere.radius / least - 1, 0.0); // less is what rounding leaves
            sum += beyond;
            largest = std::max(largest, beyond);
            for (const glm::dvec3& p : sets_[i])
                outside = std::max(outside, (glm::distance(p, sphere.centre) - sphere.radius) / least);
        }
        return {.name = name,
                .values = {made.us, sum / static_cast<double>(made.spheres.size()), largest, outside},
                .note = note,
                .is_default = is_default};
    }

private:
    const vdtree::SoundTree& tree_;
    std::vector<NodeId> nodes_;
    std::vector<std::vector<glm::dvec3>> sets_;
    std::size_t points_in_all_ = 0;
};

// Rings of some nodes, looked at from all around, and how each truly faces.
class FacingTests {
public:
    FacingTests(const AccuracySubject& subject, const vdtree::SoundTree& tree) {
        constexpr Index most_leaves = 64; // larger nodes are silhouettes from nearly everywhere
        nodes = some_nodes(tree, subject.nodes, [&](NodeId node) {
            const bool moves = tree.support_spheres()[node].radius > 0; // else the fold changes nothing, and none asks
            return moves && tree.leaf_end()[node] - tree.first_leaf()[node] <= most_leaves;
        });
        const Rings around(tree);
        for (const NodeId node : nodes) rings.push_back(around.of(node));
        // Eyes all around, as far away as the view's.
        const vdtree::Similarity& placement = subject.session.scene().objects[0].placement;
        sights_.resize(nodes.size()), truth_.resize(nodes.size());
        for (int i = 0; i < eyes; ++i) {
            vdtree::View view = vdtree::orbited(subject.view, 360.0 * i / eyes);
            view.eye.y += (i % 3 - 1) * 0.4 * glm::distance(view.eye, view.target); // from above, and from below
            const glm::dvec3 eye = vdtree::eye_in_tree(tree, view, placement);
            for (std::size_t k = 0; k < nodes.size(); ++k) sights_[k].emplace_back(eye, rings[k].sphere);
        }
        for (std::size_t k = 0; k < nodes.size(); ++k)
            for (const Sight& sight : sights_[k]) {
                truth_[k].push_back(facing_exactly(rings[k], sight));
                one_sided_ += truth_[k].back() != Facing::mixed;
            }
    }

    // `test`: of a node, by its place among the nodes.
    template <class Test>
    AccuracyPoint point(const std::string& name, double bytes, Test&& test, const std::string& note = {},
                        bool is_default = false) const {
        double false_silhouettes = 0, misses = 0;
        const double seconds = median_seconds(few_repeats, [&] {
            false_silhouettes = misses = 0;
            for (std::size_t k = 0; k < nodes.size(); ++k)
                for (std::size_t i = 0; i < sights_[k].size(); ++i) {
                    const Facing found = test(k, sights_[k][i]);
                    false_silhouettes += found == Facing::mixed && truth_[k][i] != Facing::mixed;
                    misses += found != Facing::mixed && found != truth_[k][i];
                }
        });
        return {.name = name,
                .values = {1e9 * seconds / (eyes * static_cast<double>(nodes.size())),
                           false_silhouettes / std::max(one_sided_, 1.0), misses, bytes},
                .note = note,
                .is_default = is_default};
    }

    static constexpr int eyes = 12;
    std::vector<NodeId> nodes;
    std::vector<Ring> rings;

private:
    std::vector<std::vector<Sight>> sights_;
    std::vector<std::vector<Facing>> truth_;
    double one_sided_ = 0;
};

} // namespace

AccuracyPoints sphere_points(AccuracySubject& subject) {
    const auto sound = require(vdtree::SoundTree::of(subject.session.tree()));
    const SphereSets sets(sound, subject.nodes);
    if (sets.empty()) return {};
    const SphereSets::Made smallest = sets.make(vdtree::smallest_sphere);
    return {sets.point("around the centroid", sets.make(around_centroid), smallest, sets.size()),
            sets.point("Ritter", sets.make(by_ritter), smallest),
            sets.point("Welzl, of points", smallest, smallest, "taken as exact"),
            sets.point("the program's, of children's spheres", sets.make_own(), smallest,
                       "has the children's spheres and all proxies in it, too, so that tests nest", true)};
}

AccuracyPoints facing_points(AccuracySubject& subject) {
    const auto tree = require(vdtree::SoundTree::of(subject.session.tree()));
    const FacingTests tests(subject, tree);
    const std::vector<Ring>& rings = tests.rings;
    if (rings.empty()) return {};
    AccuracyPoints points;
    for (const int side : {2, 4, 8, 12, 16}) {
        const MaskTwin twin(side);
        std::vector<MaskTwin::Bits> masks;
        for (const Ring& ring : rings) masks.push_back(twin.mask(ring));
        points.push_back(tests.point(
            "mask of 6 x " + std::to_string(side) + " x " + std::to_string(side), twin.bytes(),
            [&](std::size_t k, const Sight& s) { return twin.facing_of(masks[k], s); },
            side == 2 ? std::to_string(rings.size()) + " nodes from " + std::to_string(tests.eyes) + " eyes" : ""));
    }
    std::vector<vdtree::NormalSlabs> slabs(rings.size());
    std::vector<vdtree::NormalMask> masks(rings.size());
    std::vector<Cone> cones;
    double triangles = 0;
    for (std::size_t k = 0; k < rings.size(); ++k) {
        for (const glm::dvec3& n : rings[k].normals) {
            slabs[k].insert(n);
            masks[k].insert(vdtree::normal_cell(n));
        }
        cones.emplace_back(rings[k]);
        triangles += static_cast<double>(rings[k].normals.size()) / static_cast<double>(rings.size());
    }
    constexpr double of_slabs = sizeof(vdtree::NormalSlabs), of_both = of_slabs + sizeof(vdtree::NormalMask);
    points.push_back(tests.point("slabs", of_slabs, [&](std::size_t k, const Sight& s) {
        return facing(slabs[k], s.to_eye, s.distance, s.radius);
    }));
    points.push_back(tests.point(
        "slabs, then mask of 6 x 8 x 8", of_both,
        [&](std::size_t k, const Sight& s) { return facing(slabs[k], masks[k], s.to_eye, s.distance, s.radius); },
        "the program's; here one by one, cuts test many at once", true));
    points.push_back(tests.point(
        "cone", 4 * sizeof(float), [&](std::size_t k, const Sight& s) { return cones[k].facing_of(s); },
        "a twin; cones around cones are wider than what they hold"));
    points.push_back(tests.point(
        "each triangle, exact", triangles * 2 * sizeof(glm::vec3),
        [&](std::size_t k, const Sight& s) { return facing_exactly(rings[k], s); },
        rounded(triangles, 3) + " triangles on the average"));
    points.push_back(tests.point(
        "the tree's own slabs and masks", of_both,
        [&](std::size_t k, const Sight& s) {
            const NodeId node = tests.nodes[k];
            if (tree.bounds()[node].flags & vdtree::irregular_ring) return Facing::mixed;
            return facing(
                tree.bounds()[node].slabs, [&] { return tree.mask(node); }, s.to_eye, s.distance, s.radius);
        },
        "of more triangles: one more ring, and what folds nearby make of them; borders are outlines from everywhere"));
    return points;
}

} // namespace unseen::app
