#include <unseen/exact/exact.h>

#include <limits>
#include <optional>

#include <glm/geometric.hpp>

#include <CGAL/Exact_rational.h>

#include <unseen/vdtree/internal/normal_mask.h>
#include <unseen/vdtree/internal/triangle_plane.h>

namespace unseen::exact {

namespace {

using vdtree::Index;
using vdtree::NodeId;
using vdtree::Sphere;

using Rational = CGAL::Exact_rational;
using Vector = std::array<Rational, 3>;

// What is decided in doubles: sums of three squares of differences of floats have a relative error of a few units in
// the last place, and neither overflow nor underflow.
constexpr double rounding = 16 * std::numeric_limits<double>::epsilon();

// By which normals may miss the cell that the mask has: vdtree's cell_margin, a share of a unit vector.
constexpr double cell_margin = 1e-5;

// Radians: a normal in doubles that is this near to the exact one does, for masks and slabs have margins far above it.
constexpr double sure_angle = 1e-8;

constexpr int slab_units = 127; // of NormalSlabs in 1

// How far vdtree::plane_normal()'s rounding shifts a distance from a plane, as a share of the way to a point on it.
constexpr double plane_rounding = 0x1p-24;

constexpr Index most_leaves_measured = 4096; // of a node: verify()'s

Rational exactly(float value) { return Rational(static_cast<double>(value)); }

Vector exactly(glm::vec3 v) { return {exactly(v.x), exactly(v.y), exactly(v.z)}; }

Vector minus(const Vector& a, const Vector& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

Rational dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Vector cross(const Vector& a, const Vector& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// Whether a * sqrt(n2) <= b, for n2 >= 0.
bool scaled_at_most(const Rational& a, const Rational& n2, const Rational& b) {
    const Rational left = a * a * n2, right = b * b;
    if (a <= 0) return b >= 0 || left >= right;
    return b >= 0 && left <= right;
}

template <class Number>
std::array<Number, vdtree::NormalSlabs::axis_count> along_axes(const Number& x, const Number& y, const Number& z) {
    return {x, y, z, x + y + z, y + z - x, x - y + z, x + y - z};
}

// A triangle's normal: in doubles with a bound of its error, and in rationals where these do not do.
class Normal {
public:
    explicit Normal(const std::array<glm::vec3, 3>& corners) : corners_(corners) {
        const glm::dvec3 a(corners[0]), u = glm::dvec3(corners[1]) - a, v = glm::dvec3(corners[2]) - a;
        const glm::dvec3 n = glm::cross(u, v);
        const double length = glm::length(n);
        // The cross product is off by a few units in the last place of |u| |v|.
        is_sure_ = length * sure_angle > 8 * std::numeric_limits<double>::epsilon() * glm::length(u) * glm::length(v);
        if (is_sure_) direction_ = n / length;
    }

    bool is_none() { return !is_sure_ && dot(exact(), exact()) == 0; }
    // Whether direction() is within `sure_angle`.
    bool is_sure() const { return is_sure_; }
    glm::dvec3 direction() const { return direction_; }

    // The exact normal, of any length.
    const Vector& exact() {
        if (!exact_) {
            const Vector a = exactly(corners_[0]);
            exact_ = cross(minus(exactly(corners_[1]), a), minus(exactly(corners_[2]), a));
        }
        return *exact_;
    }
    // The exact normal in doubles, as a unit vector.
    glm::dvec3 rounded() {
        Rational largest = 0;
        for (const Rational& c : exact()) largest = std::max(largest, c < 0 ? Rational(-c) : c);
        const auto share = [&](const Rational& c) { return CGAL::to_double(Rational(c / largest)); };
        return glm::normalize(glm::dvec3(share(exact()[0]), share(exact()[1]), share(exact()[2])));
    }

private:
    const std::array<glm::vec3, 3>& corners_;
    std::optional<Vector> exact_;
    glm::dvec3 direction_ = glm::dvec3(0);
    bool is_sure_ = false;
};

class Verifier {
public:
    Verifier(const vdtree::SoundTree& tree, const Progress& progress) : tree_(tree), progress_(progress) {}

    Result<Verification> run() {
        const NodeId nodes = tree_.interior_count();
        const auto triangles = static_cast<Index>(tree_.triangles().size());
        for (NodeId node = 0; node < nodes; ++node) {
            if (is_cancelled(node, nodes, 0)) return cancelled();
            check_node(node);
            if (fault_) return fault("Node " + std::to_string(node));
        }
        for (Index t = 0; t < triangles; ++t) {
            if (is_cancelled(t, triangles, 0.5)) return cancelled();
            check_triangle(t);
            if (fault_) return fault("Triangle " + std::to_string(t));
        }
        return done_;
    }

private:
    bool is_cancelled(std::uint32_t i, std::uint32_t count, double from) const {
        constexpr std::uint32_t between = 1 << 12;
        return progress_ && i % between == 0 && !progress_(from + 0.5 * i / count, "checking exactly");
    }
    static Error cancelled() { return {ErrorCode::cancelled, "The check was cancelled."}; }
    Error fault(const std::string& of) const { return {ErrorCode::malformed_data, of + ": " + fault_}; }

    void expect(bool holds, const char* what) {
        if (!holds && !fault_) fault_ = what;
    }

    // Whether a sphere contains another one, or a point where that one's radius is 0.
    bool contains(const Sphere& outer, glm::vec3 centre, float radius) {
        ++done_.comparisons;
        const glm::dvec3 d = glm::dvec3(centre) - glm::dvec3(outer.centre);
        const double room = static_cast<double>(outer.radius) - static_cast<double>(radius);
        if (room >= 0 && glm::dot(d, d) * (1 + rounding) <= room * room * (1 - rounding)) return true;
        ++done_.in_rationals; // NaN comes here, too
        if (!std::isfinite(outer.radius + radius + glm::dot(d, d))) return false;
        const Vector between = minus(exactly(centre), exactly(outer.centre));
        const Rational exact_room = exactly(outer.radius) - exactly(radius);
        return exact_room >= 0 && dot(between, between) <= exact_room * exact_room;
    }

    void check_node(NodeId node) {
        const Sphere& support = tree_.support_spheres()[node];
        const Sphere& ring = tree_.bounds()[node].ring;
        const glm::vec3 proxy = tree_.position(node);
        expect(contains(support, proxy, 0), "the support's sphere does not contain the proxy.");
        expect(contains(ring, proxy, 0), "the ring's sphere does not contain the proxy.");
        tree_.for_each_child(node, [&](NodeId child) {
            if (tree_.is_place(child)) {
                expect(contains(support, tree_.position(child), 0), "the support's sphere does not contain a leaf.");
                return;
            }
            const Sphere &s = tree_.support_spheres()[child], &r = tree_.bounds()[child].ring;
            expect(contains(support, s.centre, s.radius), "a child's support sphere sticks out.");
            expect(contains(ring, r.centre, r.radius), "a child's ring sphere sticks out.");
        });
    }

    // At the lowest node that moves a corner; nesting carries it to the nodes above.
    void check_triangle(Index t) {
        std::array<glm::vec3, 3> corners;
        for (std::size_t k = 0; k < 3; ++k) {
            corners[k] = tree_.positions()[tree_.wedge_of_leaf(tree_.triangles()[t][k])];
            expect(contains(tree_.bounding_sphere(), corners[k], 0), "the bounding sphere does not contain a corner.");
        }
        Normal normal(corners);
        check_displacements(t, corners, normal);
        for (const Index leaf : tree_.triangles()[t]) {
            NodeId node = tree_.parents()[tree_.place_of_leaf(leaf)];
            while (node != vdtree::no_node && tree_.support_spheres()[node].radius == 0) node = tree_.parents()[node];
            if (node == vdtree::no_node) continue; // everything is at one point
            for (const glm::vec3 corner : corners)
                expect(contains(tree_.bounds()[node].ring, corner, 0),
                       "a corner is outside of the ring sphere of another corner's parent.");
            if (normal.is_none()) continue;
            expect(is_within(tree_.bounds()[node].slabs, normal),
                   "its normal is outside of the slabs of a corner's parent.");
            expect(is_near(tree_.mask(node), normal), "its normal is missing in the mask of a corner's parent.");
        }
    }

    // In the nodes above its corners that have few leaves, as verify() does.
    void check_displacements(Index t, const std::array<glm::vec3, 3>& corners, Normal& normal) {
        const glm::dvec3 a(corners[0]), unit = vdtree::plane_normal(a, glm::dvec3(corners[1]), glm::dvec3(corners[2]));
        if (unit == glm::dvec3(0)) return; // too thin to have a plane
        for (std::size_t k = 0; k < 3; ++k)
            for (NodeId node = tree_.parents()[tree_.place_of_leaf(tree_.triangles()[t][k])];
                 node != vdtree::no_node && tree_.leaf_end()[node] - tree_.first_leaf()[node] <= most_leaves_measured;
                 node = tree_.parents()[node]) {
                ++done_.comparisons;
                const glm::dvec3 way = glm::dvec3(tree_.position(node)) - glm::dvec3(corners[k]);
                const float most = tree_.displacement()[node];
                if (std::abs(glm::dot(unit, way)) + plane_rounding * glm::length(way) <= static_cast<double>(most))
                    continue;
                ++done_.in_rationals;
                expect(std::isfinite(most) && is_off_by(normal.exact(), corners[k], tree_.position(node), most),
                       "a triangle's plane is farther from the proxy than the displacement.");
            }
    }
    // At most by so much from the plane.
    static bool is_off_by(const Vector& normal, glm::vec3 on_plane, glm::vec3 point, float most) {
        const Rational off = dot(normal, minus(exactly(point), exactly(on_plane))), distance = exactly(most);
        return off * off <= distance * distance * dot(normal, normal);
    }

    // Whether lo / 127 <= normal . axis / (|normal| |axis|) <= hi / 127 along all axes.
    bool is_within(const vdtree::NormalSlabs& slabs, Normal& n) {
        done_.comparisons += 2 * vdtree::NormalSlabs::axis_count;
        if (n.is_sure()) {
            const auto along = along_axes(n.direction().x, n.direction().y, n.direction().z);
            bool is_inside = true;
            for (std::size_t k = 0; k < along.size(); ++k) {
                const double here = along[k] * (k < 3 ? 1 : 1 / std::sqrt(3.0)) * slab_units;
                const double lo = slabs.lo[k] + slab_units * sure_angle, hi = slabs.hi[k] - slab_units * sure_angle;
                is_inside = is_inside && lo <= here && here <= hi;
            }
            if (is_inside) return true;
        }
        done_.in_rationals += 2 * vdtree::NormalSlabs::axis_count;
        const auto along = along_axes(n.exact()[0], n.exact()[1], n.exact()[2]);
        for (std::size_t k = 0; k < along.size(); ++k) {
            const Rational scaled2 = dot(n.exact(), n.exact()) * (k < 3 ? 1 : 3); // of |normal| |axis|
            const Rational here = along[k] * slab_units;
            if (!scaled_at_most(Rational(static_cast<int>(slabs.lo[k])), scaled2, here)) return false;
            if (!scaled_at_most(-Rational(static_cast<int>(slabs.hi[k])), scaled2, -here)) return false;
        }
        return true;
    }

    // Whether the mask has a cell within the margin of the normal.
    bool is_near(const vdtree::NormalMask& mask, Normal& n) {
        ++done_.comparisons;
        if (n.is_sure() && mask.contains(vdtree::normal_cell(n.direction()))) return true;
        ++done_.in_rationals;
        const glm::dvec3 direction = n.rounded();
        if (mask.contains(vdtree::normal_cell(direction))) return true;
        for (int corner = 0; corner < 8; ++corner) {
            const glm::dvec3 sign(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
            if (mask.contains(vdtree::normal_cell(direction + cell_margin * sign))) return true;
        }
        return false;
    }

    const vdtree::SoundTree& tree_;
    const Progress& progress_;
    Verification done_;
    const char* fault_ = nullptr;
};

} // namespace

Result<Verification> verify_exactly(const vdtree::VertexTree& tree, const Progress& progress) {
    const auto sound = vdtree::SoundTree::of(tree);
    if (!sound) return sound.error();
    return Verifier(*sound, progress).run();
}

} // namespace unseen::exact
