// Bounds the rings of all cuts: from every triangle corner up the tree, and along each edge up the tree on both sides
// at once.
#include <unseen/perception/internal/cut_rings.h>

#include <cmath>

#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/light_bounds.h>
#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/texture_bounds.h>
#include <unseen/vdtree/internal/texture_fit.h>
#include <unseen/vdtree/internal/texture_pyramid.h>
#include <unseen/vdtree/internal/tree_parts.h>
#include <unseen/vdtree/internal/vertex_tree_data.h>

#include "measure/contacts.h"

namespace unseen::perception {

using namespace vdtree;

namespace {

// Trees are some tens of nodes deep. Where one is deeper than this, as only made-up ones are, whatever is above counts
// as reaching everywhere, so that no tree costs the square of its depth.
constexpr int most_steps = 1024;
// Likewise for the pairs of nodes in two such chains, of which usual trees have some hundreds.
constexpr std::size_t most_added = 4096;

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

// What decides which proxies a ring can have in a cut.
class Neighbours {
public:
    explicit Neighbours(const SoundTree& tree)
        : g_(*tree.data().geometry), links_(links_of(g_)), interior_(tree.interior_count()),
          leaves_(tree.interior_wedge_count()), parts_(links_) {
        parts_.assign_triangles(g_.first_triangle, g_.triangles);
    }

protected:
    bool supports(NodeId node, Index leaf) const { return g_.first_leaf[node] <= leaf && leaf < g_.leaf_end[node]; }
    // Ties go by number, so that of two nodes one is the larger.
    bool is_larger(NodeId a, NodeId b) const {
        const float ra = g_.support_spheres[a].radius, rb = g_.support_spheres[b].radius;
        return ra != rb ? ra > rb : a < b;
    }
    NodeId parent_of_leaf(Index leaf) const { return g_.parents[links_.place_of_leaf(leaf)]; }
    // From a node up, the first that the part owns: what is true of it is true of all above. Or no_node.
    NodeId lowest_owned(const TreePart& part, NodeId node) const {
        while (node != no_node && !parts_.owns(part, node)) node = parts_.is_top(node) ? no_node : g_.parents[node];
        return node;
    }
    // Calls f(part, corner, next, last) for each corner of each triangle.
    template <class F>
    void for_each_corner(F&& f) {
        parts_.for_each_triangle([&](const TreePart& part) {
            return [&](Index triangle) {
                const Triangle& t = g_.triangles[triangle];
                for (std::size_t k = 0; k < 3; ++k) f(part, t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
            };
        });
    }

    // Calls f(wedge) for each wedge of a node.
    template <class F>
    void for_each_wedge(NodeId node, F&& f) const {
        for (WedgeId w = links_.first_wedge_of(node); w < links_.first_wedge_of(node + 1); ++w) f(w);
    }

    const TreeGeometry& g_;
    TreeLinks links_;
    NodeId interior_;
    WedgeId leaves_; // the first leaf's
    TreeParts parts_;
};

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

// Light of grey trees.
struct GreyVertices {
    using Light = double;
    explicit GreyVertices(const VertexTree& tree) : luminance(tree.luminance()) {}
    double operator[](WedgeId wedge) const { return static_cast<double>(luminance[wedge].value) / Unorm16::largest; }
    double mean(WedgeId a, WedgeId b, WedgeId c) const { return ((*this)[a] + (*this)[b] + (*this)[c]) / 3; }
    std::span<const Unorm16> luminance;
};

// Light of textured trees: the vertices' luminance alone, and times the texture's.
struct TexturedVertices {
    using Light = glm::dvec2;
    explicit TexturedVertices(const VertexTree& tree)
        : luminance(tree.luminance()), uvs(tree.uvs()), pyramid(tree.texture()) {}

    glm::dvec2 mean(WedgeId a, WedgeId b, WedgeId c) const {
        const glm::dvec3 y(luminance[a].value, luminance[b].value, luminance[c].value);
        const glm::dvec2 u(uvs[a]), v(uvs[b]), w(uvs[c]);
        const double width = std::max({glm::length(v - u), glm::length(w - v), glm::length(u - w)}) / parts;
        double sum = 0;
        const auto add = [&](double second, double third) { // weights of the middle of one of the parts
            const glm::dvec3 weights(1 - second - third, second, third);
            sum += glm::dot(weights, y) * pyramid.mean(weights.x * u + weights.y * v + weights.z * w, width);
        };
        for (int i = 0; i < parts; ++i)
            for (int k = 0; i + k < parts; ++k) {
                add((i + 1.0 / 3) / parts, (k + 1.0 / 3) / parts);
                if (i + k + 1 < parts) add((i + 2.0 / 3) / parts, (k + 2.0 / 3) / parts);
            }
        return glm::dvec2((y.x + y.y + y.z) / 3, sum / (parts * parts)) / double{Unorm16::largest};
    }

    static constexpr int parts = 3; // of a side: 9 triangles, the texture's mean in each
    std::span<const Unorm16> luminance;
    std::span<const glm::vec2> uvs;
    TexturePyramid pyramid;
};

struct ColouredVertices {
    using Light = glm::dvec3;
    explicit ColouredVertices(const VertexTree& tree) : luminance(tree.luminance()), chroma(luminance.size()) {
        parallel_loop(std::size_t{0}, chroma.size(),
                      [&](std::size_t w) { chroma[w] = drawn_chroma(tree.colours()[w], luminance[w]); });
    }
    glm::dvec3 operator[](WedgeId wedge) const {
        return {static_cast<double>(luminance[wedge].value) / Unorm16::largest, chroma[wedge].x, chroma[wedge].y};
    }
    glm::dvec3 mean(WedgeId a, WedgeId b, WedgeId c) const { return ((*this)[a] + (*this)[b] + (*this)[c]) / 3.0; }
    std::span<const Unorm16> luminance;
    std::vector<glm::vec2> chroma;
};

template <class Vertices>
class RingBounder : Neighbours {
    using Light = typename Vertices::Light;
    using Lit = perception::Lit<Light>;
    static constexpr bool has_chroma = std::is_same_v<Light, glm::dvec3>;
    static constexpr bool is_textured = std::is_same_v<Light, glm::dvec2>;

public:
    RingBounder(const SoundTree& tree, std::vector<ChromaRange> ring_chroma)
        : Neighbours(tree), ring_chroma_(std::move(ring_chroma)), l_(*tree.data().light), vertices_(tree),
          around_(interior_), left_(interior_) {}

    CutRings run() {
        rings_.luminance.assign(g_.bounds.size(), {});
        rings_.radius.resize(interior_);
        rings_.mean_shift.assign(interior_, 0);
        if constexpr (has_chroma) {
            rings_.chroma = ring_chroma_;
            rings_.mean_chroma_shift.assign(interior_, glm::vec2(0));
        }
        for (NodeId node = 0; node < interior_; ++node) {
            rings_.luminance[node] = l_.ring_range[node];
            rings_.radius[node] = g_.bounds[node].ring.radius;
        }
        if constexpr (is_textured) begin_texture();
        sum_up_triangles();
        for_each_corner([&](const TreePart& part, Index here, Index next, Index last) {
            bound_along(part, here, next);
            bound_along(part, here, last);
            add_light(part, here, next, last);
        });
        if constexpr (is_textured) bound_texture();
        find_mean_shifts();
        for (NodeId node = interior_; node-- > 1;) nest(node, g_.parents[node]);
        if constexpr (is_textured) {
            float& of_root = rings_.texture_deviation[VertexTree::root()];
            of_root = std::min(of_root, 2 * rings_.radius[VertexTree::root()]);
        }
        return std::move(rings_);
    }

private:
    // What the nodes above `here` that do not support its neighbour must know of those above the neighbour.
    void bound_along(const TreePart& part, Index here, Index neighbour) {
        NodeId other = parent_of_leaf(neighbour);
        WedgeId own = links_.wedge_of_leaf(here), its = links_.wedge_of_leaf(neighbour); // that hold the two
        Box places;
        PackedRange lights = empty_range;
        ChromaRange colours{glm::vec2(1e30f), glm::vec2(-1e30f)};
        UvBox uvs;
        thread_local std::vector<WedgeId> others; // with a texture: those seen so far
        if constexpr (is_textured) others.assign(1, its);
        int steps = 0;
        for (NodeId node = parent_of_leaf(here); node != no_node && !supports(node, neighbour);
             node = g_.parents[node]) {
            for (; !supports(other, here) && !is_larger(other, node); other = g_.parents[other]) {
                its = links_.wedge_above(other, its);
                places.include(g_.positions[its]);
                if constexpr (is_textured) {
                    lights = unite(lights, shade_of(its));
                    uvs.include(g_.uvs[its]);
                    others.push_back(its);
                } else {
                    lights = unite(lights, {l_.luminance[its], l_.luminance[its]});
                }
                if constexpr (has_chroma) colours = unite(colours, {vertices_.chroma[its], vertices_.chroma[its]});
                ++steps;
            }
            own = links_.wedge_above(node, own);
            if (++steps > most_steps) return reach_everywhere(part, node);
            if (!parts_.owns(part, node)) continue;
            if constexpr (is_textured) {
                for (const WedgeId vertex : others)
                    residuals_[node] = std::max(residuals_[node], fits_.residual(own, vertex));
                footprints_[own].include(uvs);
            }
            if (places.is_empty()) continue;
            if constexpr (is_textured) rings_.vertices[node] = unite(rings_.vertices[node], lights);
            if constexpr (!is_textured) rings_.luminance[node] = unite(rings_.luminance[node], lights);
            if constexpr (has_chroma) rings_.chroma[node] = unite(rings_.chroma[node], colours);
            include(rings_.radius[node], places.farthest_from(g_.bounds[node].ring.centre));
        }
    }

    void reach_everywhere(const TreePart& part, NodeId above) {
        const NodeId node = lowest_owned(part, above);
        if (node == no_node) return;
        rings_.luminance[node] = {{0}, {Unorm16::largest}};
        if constexpr (is_textured) {
            rings_.vertices[node] = {{0}, {Unorm16::largest}};
            for_each_wedge(node, [&](WedgeId wedge) { footprints_[wedge] = footprint_of_all_; });
            residuals_[node] = std::numeric_limits<double>::infinity();
        }
        if constexpr (has_chroma) rings_.chroma[node] = ring_chroma_[VertexTree::root()];
        rings_.radius[node] = std::numeric_limits<float>::max();
    }

    // Rounded up.
    static void include(float& radius, double distance) {
        float up = static_cast<float>(distance);
        if (static_cast<double>(up) < distance) up = std::nextafter(up, infinity);
        radius = std::max(radius, up);
    }

    // To the nodes above `here` that support none of the triangle's other corners: the triangle stays when they fold.
    void add_light(const TreePart& part, Index here, Index next, Index last) {
        WedgeId own = leaves_ + here;
        const Lit before = light_of(own, leaves_ + next, leaves_ + last);
        int steps = 0;
        for (NodeId node = parent_of_leaf(here); node != no_node && !supports(node, next) && !supports(node, last);
             node = g_.parents[node]) {
            if (++steps > most_steps) return; // it reaches everywhere
            own = links_.wedge_above(node, own);
            if (!parts_.owns(part, node)) continue;
            around_[node] += before;
            left_[node] += light_of(own, leaves_ + next, leaves_ + last);
        }
    }

    Lit light_of(WedgeId a, WedgeId b, WedgeId c) const {
        const glm::dvec3 at = g_.positions[a];
        const double area =
            glm::length(glm::cross(glm::dvec3(g_.positions[b]) - at, glm::dvec3(g_.positions[c]) - at)) / 2;
        return {area, vertices_.mean(a, b, c) * area};
    }

    // ---- textures

    PackedRange shade_of(WedgeId wedge) const {
        const Unorm16 y = l_.luminance[wedge];
        return g_.colours.empty() ? PackedRange{y, y} : channel_range(g_.colours[wedge], y);
    }

    // Without the neighbours' proxies: the mesh's own rings and the subtrees.
    void begin_texture() {
        footprints_ = bound_footprints(g_, parts_);
        for_each_wedge(VertexTree::root(), [&](WedgeId wedge) { footprint_of_all_.include(footprints_[wedge]); });
        fits_ = TextureFits(g_, parts_);
        residuals_.assign(interior_, 0);
        rings_.vertices.assign(interior_, empty_range);
        parts_.for_each_triangle([&](const TreePart& part) {
            return [&](Index triangle) {
                const Triangle& t = g_.triangles[triangle];
                PackedRange range = empty_range;
                for (const Index leaf : t) range = unite(range, shade_of(leaves_ + leaf));
                for (const Index leaf : t)
                    if (const NodeId parent = parent_of_leaf(leaf); parts_.owns(part, parent))
                        rings_.vertices[parent] = unite(rings_.vertices[parent], range);
            };
        });
        for (NodeId node = interior_; node-- > 0;) {
            PackedRange& own = rings_.vertices[node];
            for_each_wedge(node, [&](WedgeId wedge) { own = unite(own, shade_of(wedge)); });
            if (node > 0)
                rings_.vertices[g_.parents[node]] = unite(rings_.vertices[g_.parents[node]], rings_.vertices[node]);
        }
        parts_.bottom_up([&] { return [&](NodeId node) { residuals_[node] = fits_.residual_of_subtree(node); }; });
    }

    // When all that the rings can show is known.
    void bound_texture() {
        rings_.texture.resize(interior_);
        rings_.texture_deviation.resize(interior_);
        for (NodeId node = interior_; node-- > 1;) {
            const NodeId parent = g_.parents[node];
            for_each_wedge(node, [&](WedgeId wedge) {
                footprints_[links_.wedge_above(parent, wedge)].include(footprints_[wedge]);
            });
            rings_.vertices[parent] = unite(rings_.vertices[parent], rings_.vertices[node]);
        }
        parallel_loop(NodeId{0}, interior_, [&](NodeId node) {
            PackedRange& texture = rings_.texture[node] = empty_range;
            for_each_wedge(
                node, [&](WedgeId wedge) { texture = unite(texture, vertices_.pyramid.range(footprints_[wedge])); });
            rings_.luminance[node] = unite(rings_.luminance[node], product(rings_.vertices[node], texture));
            float deviation = 0;
            include(deviation, 2 * residuals_[node]);
            rings_.texture_deviation[node] = deviation;
        });
        for (NodeId node = interior_; node-- > 1;)
            rings_.texture_deviation[g_.parents[node]] =
                std::max(rings_.texture_deviation[g_.parents[node]], rings_.texture_deviation[node]);
    }

    // What the light shifts by, of vertices alone and of all that is drawn. The latter is measured, by means over parts
    // of triangles; where the texture hardly moves, what it can add to the former is less than what such means are
    // wrong by.
    double shift_of_both(NodeId node, glm::dvec2 shift) const {
        const double texture_lo = rings_.texture[node].lo, texture_hi = rings_.texture[node].hi,
                     vertices_hi = rings_.vertices[node].hi;
        const double radius = g_.support_spheres[node].radius, deviation = rings_.texture_deviation[node];
        // Triangles whose points move by the deviation, against corners that do not, are stretched by it over their
        // heights, about.
        constexpr double heights_in_radius = 2;
        const double stretch = radius > 0 ? std::min(1.0, heights_in_radius * deviation / radius) : 1.0;
        return std::min(shift.y, shift.x * texture_hi + vertices_hi * (texture_hi - texture_lo) * stretch);
    }

    // Running sums: over the triangles in their order, and over the leaves of a third of the areas around each.
    void sum_up_triangles() {
        before_triangle_.resize(g_.triangles.size() + 1);
        std::vector<double> of_leaf(l_.luminance.size() - leaves_, 0.0);
        for (std::size_t t = 0; t < g_.triangles.size(); ++t) {
            const Triangle& corners = g_.triangles[t];
            const Lit light = light_of(leaves_ + corners[0], leaves_ + corners[1], leaves_ + corners[2]);
            before_triangle_[t + 1] = before_triangle_[t];
            before_triangle_[t + 1] += light;
            for (const Index leaf : corners) of_leaf[leaf] += light.area / 3;
        }
        before_leaf_.assign(of_leaf.size() + 1, 0.0);
        for (std::size_t leaf = 0; leaf < of_leaf.size(); ++leaf)
            before_leaf_[leaf + 1] = before_leaf_[leaf] + of_leaf[leaf];
    }

    void find_mean_shifts() {
        // Below this share of the whole area the differences of running sums are rounding, and nothing that is seen.
        constexpr double least_share = 1e-12;
        const double whole = before_leaf_.back();
        for (NodeId node = 0; node < interior_; ++node) {
            // With two corners or more in the support they vanish somewhere under the node.
            const Lit &first = before_triangle_[g_.first_triangle[node]],
                      &end = before_triangle_[g_.first_triangle[g_.subtree_end[node]]];
            const double area = around_[node].area + end.area - first.area;
            const Light light = around_[node].light + end.light - first.light;
            const double own = before_leaf_[g_.leaf_end[node]] - before_leaf_[g_.first_leaf[node]];
            if (!(own > least_share * whole) || !(area > 0)) continue;
            const Light shift = glm::abs(left_[node].light - light * (left_[node].area / area)) / own;
            if constexpr (has_chroma) {
                rings_.mean_shift[node] = static_cast<float>(std::min(shift.x, 1.0));
                rings_.mean_chroma_shift[node] = glm::vec2(shift.y, shift.z);
            } else if constexpr (is_textured) {
                rings_.mean_shift[node] = static_cast<float>(std::min(shift_of_both(node, shift), 1.0));
            } else {
                rings_.mean_shift[node] = static_cast<float>(std::min(shift, 1.0));
            }
        }
    }

    void nest(NodeId child, NodeId parent) {
        rings_.luminance[parent] = unite(rings_.luminance[parent], rings_.luminance[child]);
        rings_.radius[parent] = std::max(rings_.radius[parent], rings_.radius[child]);
        rings_.mean_shift[parent] = std::max(rings_.mean_shift[parent], rings_.mean_shift[child]);
        if constexpr (is_textured) // radii are those of all children now
            rings_.texture_deviation[child] = std::min(rings_.texture_deviation[child], 2 * rings_.radius[child]);
        if constexpr (has_chroma) {
            rings_.chroma[parent] = unite(rings_.chroma[parent], rings_.chroma[child]);
            rings_.mean_chroma_shift[parent] =
                glm::max(rings_.mean_chroma_shift[parent], rings_.mean_chroma_shift[child]);
        }
    }

    std::vector<ChromaRange> ring_chroma_; // where colours are looked at
    const TreeLuminance& l_;
    Vertices vertices_;
    CutRings rings_;
    std::vector<Lit> around_,
        left_; // by node: of the triangles with one corner in the support, before and after its fold
    std::vector<Lit> before_triangle_;
    std::vector<double> before_leaf_;

    // With a texture.
    std::vector<UvBox> footprints_; // by wedge
    UvBox footprint_of_all_;
    TextureFits fits_;
    std::vector<double> residuals_; // by node; mesh units
};

// The vertices of all cuts' rings, one by one: RingBounder has their luminances' ranges, which lights change.
class ChainWalker : Neighbours {
public:
    ChainWalker(const SoundTree& tree, const LightBounds::FurtherVertex& add) : Neighbours(tree), add_(add) {}

    void run() {
        for_each_corner([&](const TreePart& part, Index here, Index next, Index last) {
            walk(part, here, next);
            walk(part, here, last);
        });
    }

private:
    // What the nodes above `here` that do not support its neighbour must know of those above the neighbour.
    void walk(const TreePart& part, Index here, Index neighbour) {
        thread_local std::vector<WedgeId> others;
        others.clear();
        NodeId other = parent_of_leaf(neighbour);
        WedgeId its = links_.wedge_of_leaf(neighbour);
        std::size_t added = 0;
        for (NodeId node = parent_of_leaf(here); node != no_node && !supports(node, neighbour);
             node = g_.parents[node]) {
            for (; !supports(other, here) && !is_larger(other, node); other = g_.parents[other])
                others.push_back(its = links_.wedge_above(other, its));
            added += others.size() + 1;
            if (added > most_added) { // whatever is above counts as reaching everywhere
                if (const NodeId owned = lowest_owned(part, node); owned != no_node) add_(owned, no_node);
                return;
            }
            if (!parts_.owns(part, node)) continue;
            for (const WedgeId vertex : others) add_(node, vertex);
        }
    }

    const LightBounds::FurtherVertex& add_;
};

} // namespace

Result<CutRings> bound_cut_rings(const VertexTree& tree, bool with_chroma) {
    const auto sound = SoundTree::of(tree);
    if (!sound) return sound.error();
    const bool is_textured = !tree.texture().empty();
    std::vector<ChromaRange> chroma;
    if (with_chroma && !is_textured) {
        auto found = ring_chroma(tree);
        if (!found) return found.error();
        chroma = std::move(*found);
    }
    const bool has_colours = !chroma.empty(); // of textured trees nothing counts as alike in any case
    CutRings rings = is_textured      ? RingBounder<TexturedVertices>(*sound, {}).run()
                     : chroma.empty() ? RingBounder<GreyVertices>(*sound, {}).run()
                                      : RingBounder<ColouredVertices>(*sound, std::move(chroma)).run();
    // What comes as near as a quarter of a triangle is in the way of any fold.
    const Progress nobody;
    MeasuringProgress progress(nobody);
    const std::vector<Contact> contacts = find_contacts(std::span(&*sound, 1), has_colours, progress);
    if (std::any_of(contacts.begin(), contacts.end(), std::mem_fn(&Contact::is_any))) {
        rings.meets_another.resize(contacts.size());
        std::transform(contacts.begin(), contacts.end(), rings.meets_another.begin(), std::mem_fn(&Contact::is_any));
    }
    return rings;
}

Result<LightBounds> bound_lit_cut_rings(const VertexTree& tree, const CutRings& rings) {
    const auto sound = SoundTree::of(tree);
    if (!sound) return sound.error();
    if (rings.radius.size() != tree.interior_count()) return invalid_argument("The rings are not those of the tree.");
    return LightBounds::measure(tree, rings.radius,
                                [&](const LightBounds::FurtherVertex& add) { ChainWalker(*sound, add).run(); });
}

} // namespace unseen::perception
