// Bounds the rings of all cuts: from every triangle corner up the tree, and along each edge up the tree on both sides at once.
#include <vdtree/cut_rings.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <tbb/parallel_for.h>

#include "chroma.h"
#include "tree_parts.h"
#include "vertex_tree_data.h"

namespace unseen::vdtree {

namespace {

// Trees are some tens of nodes deep. Where one is deeper than this, as only made-up ones are, whatever is above counts as reaching
// everywhere, so that no tree costs the square of its depth.
constexpr int most_steps = 1024;

constexpr float infinity = std::numeric_limits<float>::infinity();

struct Box {
    glm::vec3 low = glm::vec3(infinity), high = glm::vec3(-infinity);

    void include(const glm::vec3& p) {
        low = glm::min(low, p);
        high = glm::max(high, p);
    }
    bool is_empty() const { return !(low.x <= high.x); }
    double farthest_from(const glm::vec3& point) const {
        const glm::dvec3 p(point);
        return glm::length(glm::max(glm::abs(glm::dvec3(low) - p), glm::abs(glm::dvec3(high) - p)));
    }
};

PackedRange unite(PackedRange a, PackedRange b) { return {std::min(a.lo, b.lo), std::max(a.hi, b.hi)}; }

// An area, and what is drawn there times the area.
template <class Light> // luminance, or luminance and chroma
struct Lit {
    double area = 0;
    Light light = Light(0);
    Lit& operator+=(const Lit& other) {
        area += other.area;
        light += other.light;
        return *this;
    }
};

// Of grey trees.
struct GreyVertices {
    using Light = double;
    explicit GreyVertices(const VertexTree& tree) : luminance(tree.luminance()) {}
    double operator[](NodeId node) const { return static_cast<double>(luminance[node].value) / Unorm16::largest; }
    std::span<const Unorm16> luminance;
};

struct ColouredVertices {
    using Light = glm::dvec3;
    explicit ColouredVertices(const VertexTree& tree) : luminance(tree.luminance()), chroma(luminance.size()) {
        tbb::parallel_for(std::size_t{0}, chroma.size(),
                          [&](std::size_t node) { chroma[node] = drawn_chroma(tree.colours()[node], luminance[node]); });
    }
    glm::dvec3 operator[](NodeId node) const {
        return {static_cast<double>(luminance[node].value) / Unorm16::largest, chroma[node].x, chroma[node].y};
    }
    std::span<const Unorm16> luminance;
    std::vector<glm::vec2> chroma;
};

template <class Vertices>
class RingBounder {
    using Light = typename Vertices::Light;
    using Lit = vdtree::Lit<Light>;
    static constexpr bool has_chroma = !std::is_same_v<Light, double>;

public:
    explicit RingBounder(const VertexTree& tree)
        : tree_(tree), g_(*tree.data().geometry), l_(tree.data().light), interior_(tree.interior_count()), vertices_(tree),
          parts_({g_.parents, g_.first_leaf, g_.leaf_end, g_.subtree_end}), around_(interior_), left_(interior_) {
        parts_.assign_triangles(g_.first_triangle, g_.triangles);
    }

    CutRings run() {
        rings_.luminance.assign(g_.bounds.size(), {});
        rings_.radius.resize(interior_);
        rings_.mean_shift.assign(interior_, 0);
        if constexpr (has_chroma) {
            rings_.chroma.assign(l_.ring_chroma.begin(), l_.ring_chroma.end());
            rings_.mean_chroma_shift.assign(interior_, glm::vec2(0));
        }
        for (NodeId node = 0; node < interior_; ++node) {
            rings_.luminance[node] = l_.ring_range[node];
            rings_.radius[node] = g_.bounds[node].ring.radius;
        }
        sum_up_triangles();
        parts_.for_each_triangle([&](const TreePart& part) {
            return [&](Index triangle) {
                const Triangle& t = g_.triangles[triangle];
                for (std::size_t k = 0; k < 3; ++k) {
                    const Index here = t[k], next = t[(k + 1) % 3], last = t[(k + 2) % 3];
                    bound_along(part, here, next);
                    bound_along(part, here, last);
                    add_light(part, here, next, last);
                }
            };
        });
        find_mean_shifts();
        for (NodeId node = interior_; node-- > 1;) nest(node, g_.parents[node]);
        return std::move(rings_);
    }

private:
    bool supports(NodeId node, Index leaf) const { return g_.first_leaf[node] <= leaf && leaf < g_.leaf_end[node]; }
    bool is_larger(NodeId a, NodeId b) const {
        const float ra = g_.support_spheres[a].radius, rb = g_.support_spheres[b].radius;
        return ra != rb ? ra > rb : a < b;
    }
    NodeId parent_of_leaf(Index leaf) const { return g_.parents[interior_ + leaf]; }

    // What the nodes above `here` that do not support its neighbour must know of those above the neighbour.
    void bound_along(const TreePart& part, Index here, Index neighbour) {
        NodeId other = parent_of_leaf(neighbour);
        Box places;
        PackedRange lights{{Unorm16::largest}, {0}};
        ChromaRange colours = no_chroma_yet;
        int steps = 0;
        for (NodeId node = parent_of_leaf(here); node != no_node && !supports(node, neighbour); node = g_.parents[node]) {
            for (; !supports(other, here) && !is_larger(other, node); other = g_.parents[other]) {
                places.include(g_.positions[other]);
                lights = unite(lights, {l_.luminance[other], l_.luminance[other]});
                if constexpr (has_chroma) colours = unite(colours, {vertices_.chroma[other], vertices_.chroma[other]});
                ++steps;
            }
            if (++steps > most_steps) return reach_everywhere(part, node);
            if (!parts_.owns(part, node) || places.is_empty() || is_coincident(node)) continue;
            rings_.luminance[node] = unite(rings_.luminance[node], lights);
            if constexpr (has_chroma) rings_.chroma[node] = unite(rings_.chroma[node], colours);
            include(rings_.radius[node], places.farthest_from(g_.bounds[node].ring.centre));
        }
    }

    // What is true of the lowest node that the part owns is true of all above.
    void reach_everywhere(const TreePart& part, NodeId node) {
        while (node != no_node && !parts_.owns(part, node)) node = parts_.is_top(node) ? no_node : g_.parents[node];
        if (node == no_node) return;
        rings_.luminance[node] = {{0}, {Unorm16::largest}};
        if constexpr (has_chroma) rings_.chroma[node] = l_.ring_chroma[VertexTree::root()];
        rings_.radius[node] = std::numeric_limits<float>::max();
    }

    // When it folds nothing moves.
    bool is_coincident(NodeId node) const { return g_.support_spheres[node].radius == 0; }

    // Rounded up.
    static void include(float& radius, double distance) {
        float up = static_cast<float>(distance);
        if (static_cast<double>(up) < distance) up = std::nextafter(up, infinity);
        radius = std::max(radius, up);
    }

    // To the nodes above `here` that support none of the triangle's other corners: the triangle stays when they fold.
    void add_light(const TreePart& part, Index here, Index next, Index last) {
        const Lit before = light_of(interior_ + here, interior_ + next, interior_ + last);
        int steps = 0;
        for (NodeId node = parent_of_leaf(here); node != no_node && !supports(node, next) && !supports(node, last);
             node = g_.parents[node]) {
            if (++steps > most_steps) return; // it reaches everywhere
            if (!parts_.owns(part, node)) continue;
            around_[node] += before;
            left_[node] += light_of(node, interior_ + next, interior_ + last);
        }
    }

    Lit light_of(NodeId a, NodeId b, NodeId c) const {
        const glm::dvec3 at = g_.positions[a];
        const double area = glm::length(glm::cross(glm::dvec3(g_.positions[b]) - at, glm::dvec3(g_.positions[c]) - at)) / 2;
        return {area, (vertices_[a] + vertices_[b] + vertices_[c]) * (area / 3)};
    }

    // Running sums: over the triangles in their order, and over the leaves of a third of the areas around each.
    void sum_up_triangles() {
        before_triangle_.resize(g_.triangles.size() + 1);
        std::vector<double> of_leaf(tree_.leaf_count(), 0.0);
        for (std::size_t t = 0; t < g_.triangles.size(); ++t) {
            const Triangle& corners = g_.triangles[t];
            const Lit light = light_of(interior_ + corners[0], interior_ + corners[1], interior_ + corners[2]);
            before_triangle_[t + 1] = before_triangle_[t];
            before_triangle_[t + 1] += light;
            for (const Index leaf : corners) of_leaf[leaf] += light.area / 3;
        }
        before_leaf_.assign(of_leaf.size() + 1, 0.0);
        for (std::size_t leaf = 0; leaf < of_leaf.size(); ++leaf) before_leaf_[leaf + 1] = before_leaf_[leaf] + of_leaf[leaf];
    }

    void find_mean_shifts() {
        // Below this share of the whole area the differences of running sums are rounding, and nothing that is seen.
        constexpr double least_share = 1e-12;
        const double whole = before_leaf_.back();
        for (NodeId node = 0; node < interior_; ++node) {
            // With two corners or more in the support they vanish somewhere under the node.
            const Lit &first = before_triangle_[g_.first_triangle[node]], &end = before_triangle_[g_.first_triangle[g_.subtree_end[node]]];
            const double area = around_[node].area + end.area - first.area;
            const Light light = around_[node].light + end.light - first.light;
            const double own = before_leaf_[g_.leaf_end[node]] - before_leaf_[g_.first_leaf[node]];
            if (!(own > least_share * whole) || !(area > 0)) continue;
            const Light shift = glm::abs(left_[node].light - light * (left_[node].area / area)) / own;
            if constexpr (has_chroma) {
                rings_.mean_shift[node] = static_cast<float>(std::min(shift.x, 1.0));
                rings_.mean_chroma_shift[node] = glm::vec2(shift.y, shift.z);
            } else {
                rings_.mean_shift[node] = static_cast<float>(std::min(shift, 1.0));
            }
        }
    }

    void nest(NodeId child, NodeId parent) {
        rings_.luminance[parent] = unite(rings_.luminance[parent], rings_.luminance[child]);
        rings_.radius[parent] = std::max(rings_.radius[parent], rings_.radius[child]);
        rings_.mean_shift[parent] = std::max(rings_.mean_shift[parent], rings_.mean_shift[child]);
        if constexpr (has_chroma) {
            rings_.chroma[parent] = unite(rings_.chroma[parent], rings_.chroma[child]);
            rings_.mean_chroma_shift[parent] = glm::max(rings_.mean_chroma_shift[parent], rings_.mean_chroma_shift[child]);
        }
    }

    const VertexTree& tree_;
    const TreeGeometry& g_;
    const TreeLuminance& l_;
    NodeId interior_;
    Vertices vertices_;
    TreeParts parts_;
    CutRings rings_;
    std::vector<Lit> around_, left_; // by node: of the triangles with one corner in the support, before and after its fold
    std::vector<Lit> before_triangle_;
    std::vector<double> before_leaf_;
};

} // namespace

CutRings bound_cut_rings(const VertexTree& tree) {
    return tree.ring_chroma().empty() ? RingBounder<GreyVertices>(tree).run() : RingBounder<ColouredVertices>(tree).run();
}

} // namespace unseen::vdtree
