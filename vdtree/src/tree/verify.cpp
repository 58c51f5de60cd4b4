// Checks everything that a vertex tree promises.
#include <optional>

#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/normal_mask.h>
#include <unseen/vdtree/internal/texture_bounds.h>
#include <unseen/vdtree/internal/triangle_plane.h>

namespace unseen::vdtree {

namespace {

// Whether `inner` lies in `outer`. The difference of two floats is exact in double, squares and their sum lose a few
// units in the last place: this much relative slack, far below the rounding outward of the radii, is not counted as a
// fault.
constexpr double slack = 1e-14;

bool contains(const Sphere& outer, glm::vec3 point, double radius) {
    const glm::dvec3 d = glm::dvec3(point) - glm::dvec3(outer.centre);
    return glm::length(d) + radius <= outer.radius * (1 + slack);
}

bool contains(PackedRange outer, PackedRange inner) { return outer.lo <= inner.lo && inner.hi <= outer.hi; }

class Verifier {
public:
    explicit Verifier(const SoundTree& tree) : tree_(tree), g_(*tree.data().geometry), l_(*tree.data().light) {}

    Result<void> run() {
        for (NodeId node = 0; node < tree_.interior_count(); ++node) {
            check_vertices(node);
            check_children(node);
            if (!fault_.empty())
                return Error{ErrorCode::malformed_data, "Node " + std::to_string(node) + ": " + fault_};
        }
        for (NodeId node = 0; node < tree_.interior_count(); ++node)
            for (Index t = g_.first_triangle[node]; t < g_.first_triangle[node + 1]; ++t)
                if (vanishing_node(g_.triangles[t]) != node)
                    return Error{ErrorCode::malformed_data, "Triangle " + std::to_string(t) +
                                                                " does not vanish at node " + std::to_string(node) +
                                                                "."};
        for (std::size_t t = 0; t < g_.triangles.size(); ++t) {
            check_rings(g_.triangles[t]);
            check_displacements(g_.triangles[t]);
            check_wedges(g_.triangles[t]);
            if (!fault_.empty())
                return Error{ErrorCode::malformed_data, "Triangle " + std::to_string(t) + ": " + fault_};
        }
        return {};
    }

private:
    void expect(bool holds, const char* what) {
        if (!holds && fault_.empty()) fault_ = what;
    }

    // What the node promises of its own proxy and of the leaves that are its children.
    void check_vertices(NodeId node) {
        const glm::vec3 proxy = tree_.position(node);
        expect(contains(g_.support_spheres[node], proxy, 0), "the support's sphere does not contain the proxy.");
        expect(contains(g_.bounds[node].ring, proxy, 0), "the ring's sphere does not contain the proxy.");
        for (WedgeId w = tree_.first_wedge(node); w < tree_.wedge_end(node); ++w) check_wedge(node, w);
    }

    void check_wedge(NodeId node, WedgeId w) {
        expect(g_.positions[w] == tree_.position(node), "its wedges are at different places.");
        const Unorm16 y = l_.luminance[w];
        expect(contains(l_.support_range[node], {y, y}), "the support's luminance does not contain the proxy's.");
        if (tree_.has_seams() && w > tree_.first_wedge(node))
            expect(links_of(g_).rank_of(w - 1) < links_of(g_).rank_of(w),
                   "its wedges are not in the order of their ranks.");
        if (!pyramid_) return;
        const PackedRange texture = texture_of({w});
        expect(contains(g_.ring_texture[node], texture), "the ring's texture does not contain the proxy's.");
        expect(contains(l_.ring_range[node], drawn(shade_of({w}), texture, {w})),
               "the ring's luminance does not contain what its proxy shows.");
    }

    // That corners of a triangle which meet in a node are of one wedge from there up.
    void check_wedges(const Triangle& t) {
        for (std::size_t k = 0; k < 3 && tree_.has_seams(); ++k) {
            const Index a = t[k], b = t[(k + 1) % 3];
            for (NodeId node = g_.parents[tree_.place_of_leaf(a)]; node != no_node; node = g_.parents[node])
                if (g_.first_leaf[node] <= b && b < g_.leaf_end[node])
                    expect(tree_.wedge_at(node, a) == tree_.wedge_at(node, b),
                           "two of its corners meet in a node and are not of one wedge.");
        }
    }

    void check_children(NodeId node) {
        tree_.for_each_child(node, [&](NodeId child) {
            if (tree_.is_place(child)) {
                expect(contains(g_.support_spheres[node], tree_.position(child), 0),
                       "the support's sphere does not contain a leaf.");
                for (WedgeId w = tree_.first_wedge(child); w < tree_.wedge_end(child); ++w)
                    expect(contains(l_.support_range[node], {l_.luminance[w], l_.luminance[w]}),
                           "the support's luminance does not contain a leaf's.");
                return;
            }
            const Sphere &s = g_.support_spheres[child], &r = g_.bounds[child].ring;
            expect(contains(g_.support_spheres[node], s.centre, s.radius), "a child's support sphere sticks out.");
            expect(contains(g_.bounds[node].ring, r.centre, r.radius), "a child's ring sphere sticks out.");
            expect(tree_.mask(node).includes(tree_.mask(child)), "a child's mask has other cells.");
            expect(g_.bounds[node].slabs.includes(g_.bounds[child].slabs), "a child's slabs stick out.");
            expect((g_.bounds[child].flags & ~g_.bounds[node].flags) == 0, "a child has other flags.");
            expect(g_.displacement[node] >= g_.displacement[child], "a child's displacement is larger.");
            expect(l_.adaptation[node] >= l_.adaptation[child], "a child's adaptation luminance is higher.");
            expect(contains(l_.support_range[node], l_.support_range[child]),
                   "a child's support luminance sticks out.");
            expect(contains(l_.ring_range[node], l_.ring_range[child]), "a child's ring luminance sticks out.");
            expect(!pyramid_ || contains(g_.ring_texture[node], g_.ring_texture[child]),
                   "a child's texture sticks out.");
        });
    }

    // That no node above a corner has its proxy farther from the triangle's plane.
    void check_displacements(const Triangle& t) {
        std::array<glm::dvec3, 3> at;
        for (std::size_t k = 0; k < 3; ++k) at[k] = glm::dvec3(g_.positions[tree_.wedge_of_leaf(t[k])]);
        const glm::dvec3 normal = plane_normal(at[0], at[1], at[2]);
        for (std::size_t k = 0; k < 3; ++k)
            for (NodeId node = g_.parents[tree_.place_of_leaf(t[k])];
                 node != no_node && g_.leaf_end[node] - g_.first_leaf[node] <= most_leaves_measured;
                 node = g_.parents[node])
                expect(std::abs(glm::dot(normal, glm::dvec3(tree_.position(node)) - at[k])) <= g_.displacement[node],
                       "a triangle's plane is farther from the proxy than the displacement.");
    }

    // That the lowest node which moves a corner knows the whole triangle; nesting carries it to the nodes above.
    void check_rings(const Triangle& t) {
        const WedgeId first = tree_.wedge_of_leaf(0);
        const glm::dvec3 a = g_.positions[first + t[0]], b = g_.positions[first + t[1]], c = g_.positions[first + t[2]];
        const glm::dvec3 normal = glm::cross(b - a, c - a);
        const int cell = normal_cell(normal);
        const PackedRange texture = pyramid_ ? texture_of({first + t[0], first + t[1], first + t[2]}) : PackedRange{};
        const PackedRange shown = pyramid_ ? drawn(shade_of({first + t[0], first + t[1], first + t[2]}), texture,
                                                   {first + t[0], first + t[1], first + t[2]})
                                           : PackedRange{};
        const bool shows_through = !g_.colours.empty() && std::any_of(t.begin(), t.end(), [&](Index leaf) {
            return !(g_.colours[first + leaf].a >= 1);
        });
        for (const Index leaf : t) {
            NodeId node = g_.parents[tree_.place_of_leaf(leaf)];
            while (node != no_node && g_.support_spheres[node].radius == 0) node = g_.parents[node];
            if (node == no_node) continue; // everything is at one point
            expect(!shows_through || (g_.bounds[node].flags & translucent_ring),
                   "a corner's parent does not know of an alpha below 1.");
            expect(cell < 0 || tree_.mask(node).contains(cell),
                   "a normal is missing in the mask of a corner's parent.");
            expect(!pyramid_ || contains(g_.ring_texture[node], texture),
                   "a triangle's texture is outside of that of the ring of a corner's parent.");
            expect(!pyramid_ || contains(l_.ring_range[node], shown),
                   "what a triangle shows is outside of the luminance of the ring of a corner's parent.");
            for (const Index corner : t) {
                const Unorm16 y = l_.luminance[first + corner];
                expect(contains(g_.bounds[node].ring, g_.positions[first + corner], 0),
                       "a corner is outside of the ring sphere of another corner's parent.");
                expect(pyramid_ || contains(l_.ring_range[node], {y, y}),
                       "a corner's luminance is outside of the ring's of another corner's parent.");
            }
        }
    }

    // Luminance ranges of the texture over the box of these vertices, and of the vertices themselves.
    PackedRange range_over(const TexturePyramid& map, std::initializer_list<WedgeId> wedges) const {
        UvBox box;
        for (const WedgeId w : wedges) box.include(g_.uvs[w]);
        return map.range(box);
    }
    PackedRange texture_of(std::initializer_list<WedgeId> wedges) const { return range_over(*pyramid_, wedges); }
    PackedRange drawn(PackedRange shade, PackedRange texture, std::initializer_list<WedgeId> wedges) const {
        const PackedRange own = product(shade, texture);
        return emission_ ? sum(own, range_over(*emission_, wedges)) : own;
    }
    PackedRange shade_of(std::initializer_list<WedgeId> wedges) const {
        PackedRange range = empty_range;
        for (const WedgeId w : wedges) {
            const Unorm16 y = l_.luminance[w];
            range = unite(range, g_.colours.empty() ? PackedRange{y, y} : channel_range(g_.colours[w], y));
        }
        return range;
    }

    NodeId vanishing_node(const Triangle& t) const {
        const auto inside = [&](NodeId node) {
            int corners = 0;
            for (const Index leaf : t) corners += g_.first_leaf[node] <= leaf && leaf < g_.leaf_end[node];
            return corners;
        };
        NodeId deepest = no_node;
        for (const Index leaf : t) {
            NodeId node = g_.parents[tree_.place_of_leaf(leaf)];
            while (inside(node) < 2) node = g_.parents[node];
            if (deepest == no_node || node > deepest) deepest = node;
        }
        return deepest;
    }

    static constexpr Index most_leaves_measured = 4096;

    const SoundTree& tree_;
    const TreeGeometry& g_;
    const TreeLuminance& l_;
    const std::optional<TexturePyramid> pyramid_ =
        l_.textured ? std::optional<TexturePyramid>(g_.texture_view()) : std::nullopt;
    const std::optional<TexturePyramid> emission_ =
        l_.textured && !g_.emission.empty() ? std::optional<TexturePyramid>(g_.emission_view()) : std::nullopt;
    std::string fault_;
};

} // namespace

Result<void> verify(const VertexTree& tree) {
    const auto sound = SoundTree::of(tree);
    if (!sound) return sound.error();
    return Verifier(*sound).run();
}

} // namespace unseen::vdtree
