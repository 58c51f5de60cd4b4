// What the vertices of rings have in normals and albedos.

#include <cmath>
#include <numbers>

#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/light_bounds.h>
#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/texture_bounds.h>

namespace unseen::vdtree {

namespace {

// Nodes with at most this many leaves use each normal; larger ones use their children's cones.
constexpr Index looked_at_each = 32;
constexpr float widest_box = 1; // radians; beyond, a cone holds little that its box does not
// Radians: normals and axes in floats, and the angle's own way there.
constexpr float cone_rounding = 1e-5f;

class Measurer {
public:
    explicit Measurer(const SoundTree& tree)
        : tree_(tree), interior_(tree.interior_count()), cones_(interior_), angles_(interior_),
          normals_(tree.wedge_count()), albedo_(tree.wedge_count()), start_(tree.leaf_count() + 1, 0),
          sums_(tree.leaf_count() + 1, glm::dvec3(0)) {}

    std::vector<VertexCone> run(const FunctionRef<void(const LightBounds::FurtherVertex&)>* further_vertices) {
        parallel_loop(WedgeId{0}, tree_.wedge_count(), [&](WedgeId w) {
            normals_[w] = tree_.normals()[w];
            albedo_[w] = albedos_of(w);
        });
        find_neighbours();
        for (Index leaf = 0; leaf < tree_.leaf_count(); ++leaf)
            sums_[leaf + 1] = sums_[leaf] + glm::dvec3(normals_[tree_.wedge_of_leaf(leaf)]);
        if (further_vertices) {
            further_.resize(interior_);
            parallel_loop(NodeId{0}, interior_, [&](NodeId node) { further_[node] = nothing_of(node); });
            const auto add = [&](NodeId node, WedgeId vertex) {
                if (vertex != no_node) see(vertex, further_[node]);
                else further_[node].is_unknown = true;
            };
            (*further_vertices)(add);
            for (NodeId node = interior_; node-- > 0;) {
                Seen& seen = further_[node];
                if (!seen.is_unknown) continue;
                seen.everywhere = true, seen.lo = 0, seen.hi = 1;
                if (node > 0) further_[tree_.parents()[node]].is_unknown = true;
            }
        }
        constexpr NodeId grain = 1024;
        parallel_loop_over(tbb::blocked_range<NodeId>(0, interior_, grain), [&](const auto& range) {
            for (NodeId node = range.begin(); node < range.end(); ++node)
                if (is_small(node)) measure_each(node);
        });
        for (NodeId node = interior_; node-- > 0;)
            if (!is_small(node)) measure_children(node);
        // What the texture leaves of the albedo; highlights are not its.
        const auto texture = tree_.ring_texture();
        for (NodeId node = 0; node < texture.size(); ++node) {
            LuminanceRange& albedo = cones_[node].albedo;
            albedo = {albedo.lo * texture[node].lo, albedo.hi * texture[node].hi};
        }
        return std::move(cones_);
    }

private:
    // What has been seen so far of a node's vertices.
    struct Seen {
        glm::vec3 axis{0};
        float squared_chord = 0, angle = 0;
        bool everywhere = false, is_unknown = false;
        float lo = 1, hi = 0;
        glm::vec3 across[2];
        float least_across[2] = {2, 2}, largest_across[2] = {-2, -2};
    };

    // With a texture, over the channels of the colour that it is multiplied with.
    LuminanceRange albedos_of(WedgeId wedge) const {
        const float albedo = albedo_of(tree_, wedge);
        if (tree_.texture().empty() || tree_.colours().empty()) return {albedo, albedo};
        return channel_range(tree_.colours()[wedge], Unorm16::nearest(static_cast<double>(albedo)));
    }

    bool is_small(NodeId node) const { return tree_.leaf_end()[node] - tree_.first_leaf()[node] <= looked_at_each; }

    void find_neighbours() {
        for (const Triangle& t : tree_.triangles())
            for (const Index leaf : t) start_[leaf] += 2;
        std::partial_sum(start_.begin(), start_.end(), start_.begin());
        neighbours_.resize(start_.back());
        for (const Triangle& t : tree_.triangles()) {
            for (std::size_t k = 0; k < 3; ++k) {
                neighbours_[--start_[t[k]]] = t[(k + 1) % 3];
                neighbours_[--start_[t[k]]] = t[(k + 2) % 3];
            }
        }
    }

    Seen begin(NodeId node) const { return further_.empty() ? nothing_of(node) : further_[node]; }
    Seen nothing_of(NodeId node) const {
        const glm::dvec3 sum = sums_[tree_.leaf_end()[node]] - sums_[tree_.first_leaf()[node]];
        const double length = glm::length(sum);
        Seen seen;
        if (length > 1e-6) seen.axis = glm::vec3(sum / length);
        else seen.everywhere = true;
        across_axis(seen.axis, seen.across[0], seen.across[1]);
        return seen;
    }

    void see(WedgeId wedge, Seen& seen) const {
        seen.lo = std::min(seen.lo, albedo_[wedge].lo);
        seen.hi = std::max(seen.hi, albedo_[wedge].hi);
        const glm::vec3 normal = normals_[wedge], apart = normal - seen.axis;
        if (normal == glm::vec3(0)) seen.everywhere = true;
        seen.squared_chord = std::max(seen.squared_chord, glm::dot(apart, apart));
        for (int k = 0; k < 2; ++k) {
            const float along = glm::dot(normal, seen.across[k]);
            seen.least_across[k] = std::min(seen.least_across[k], along);
            seen.largest_across[k] = std::max(seen.largest_across[k], along);
        }
    }
    void see_leaf(Index leaf, Seen& seen) const {
        const WedgeId first = tree_.wedge_of_leaf(0);
        see(first + leaf, seen);
        for (Index i = start_[leaf]; i < start_[leaf + 1]; ++i) see(first + neighbours_[i], seen);
    }

    void see_all(WedgeId begin, WedgeId end, Seen& seen) const {
        for (WedgeId w = begin; w < end; ++w) see(w, seen);
    }

    void end(NodeId node, const Seen& seen) {
        const float chord = std::sqrt(seen.squared_chord);
        float angle = std::max(seen.angle, 2 * std::asin(std::min(chord * 0.5f, 1.0f))) + cone_rounding;
        if (seen.everywhere || !(angle < std::numbers::pi_v<float>)) angle = std::numbers::pi_v<float>;
        const bool all = angle == std::numbers::pi_v<float>;
        angles_[node] = angle;
        VertexCone& cone = cones_[node];
        cone.axis = seen.axis == glm::vec3(0) ? glm::vec3(0, 0, 1) : seen.axis;
        cone.cosine = all ? -1 : std::cos(angle);
        cone.sine = all ? 0 : std::sin(angle);
        cone.albedo = {seen.lo, seen.hi};
        if (!(angle < widest_box) || !is_small(node)) return;
        for (int k = 0; k < 2; ++k) {
            cone.least_across[k] = seen.least_across[k] - cone_rounding;
            cone.largest_across[k] = seen.largest_across[k] + cone_rounding;
        }
    }

    void measure_each(NodeId node) {
        Seen seen = begin(node);
        for (Index leaf = tree_.first_leaf()[node]; leaf < tree_.leaf_end()[node]; ++leaf) see_leaf(leaf, seen);
        see_all(tree_.first_wedge(node), tree_.first_wedge(tree_.subtree_end()[node]), seen);
        end(node, seen);
    }

    void measure_children(NodeId node) {
        Seen seen = begin(node);
        see_all(tree_.first_wedge(node), tree_.wedge_end(node), seen);
        tree_.for_each_child(node, [&](NodeId child) {
            if (tree_.is_place(child)) {
                for (WedgeId w = tree_.first_wedge(child); w < tree_.wedge_end(child); ++w)
                    see_leaf(w - tree_.wedge_of_leaf(0), seen);
                return;
            }
            const VertexCone& cone = cones_[child];
            seen.lo = std::min(seen.lo, cone.albedo.lo);
            seen.hi = std::max(seen.hi, cone.albedo.hi);
            const float chord = std::min(glm::length(cone.axis - seen.axis) * 0.5f, 1.0f);
            seen.angle = std::max(seen.angle, angles_[child] + 2 * std::asin(chord));
        });
        end(node, seen);
    }

    const SoundTree& tree_;
    NodeId interior_;
    std::vector<VertexCone> cones_;
    std::vector<float> angles_;             // by interior node
    std::vector<glm::vec3> normals_;        // by wedge
    std::vector<LuminanceRange> albedo_;    // by wedge
    std::vector<Index> start_, neighbours_; // by leaf: those that it shares triangles with, some more than once
    std::vector<glm::dvec3> sums_;          // by leaf: of the normals of those before it
    std::vector<Seen> further_;             // by interior node, where there are further vertices: what they have
};

} // namespace

Result<LightBounds> LightBounds::measure(const VertexTree& tree) {
    const auto sound = SoundTree::of(tree);
    if (!sound) return sound.error();
    LightBounds bounds;
    bounds.cones_ = Measurer(*sound).run(nullptr);
    return bounds;
}

Result<LightBounds> LightBounds::measure(const VertexTree& tree, std::vector<float> radii,
                                         const FunctionRef<void(const FurtherVertex&)>& vertices) {
    const auto sound = SoundTree::of(tree);
    if (!sound) return sound.error();
    assert(radii.size() == tree.interior_count());
    LightBounds bounds;
    bounds.cones_ = Measurer(*sound).run(&vertices);
    bounds.radii_ = std::move(radii);
    return bounds;
}

} // namespace unseen::vdtree
