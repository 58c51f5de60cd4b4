#include <unseen/vdtree/vertex_tree.h>

#include <glm/geometric.hpp>

#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/leaf_runs.h>
#include <unseen/vdtree/internal/texture_bounds.h>

#include "tree/mask_pool.h"
#include "tree/needs.h"
#include "tree/node_check.h"

namespace unseen::vdtree {

namespace {

PackedRange unite(PackedRange a, Unorm16 y) { return unite(a, PackedRange{y, y}); }

// Rounded up: eyes adapted to more light see no less.
Unorm16 middle(PackedRange r) { return {static_cast<std::uint16_t>((r.lo.value + r.hi.value + 1) / 2)}; }

// By leaf: the luminance of the triangles around it, and a third of their area, in double against overflow at extreme
// scales. And the luminance of all corners.
struct LeafSurroundings {
    std::vector<PackedRange> ring;
    std::vector<double> areas;
    PackedRange corners = empty_range;
};

// By wedge: what the texture is multiplied with, over the three channels of colour; for others, the luminance alone.
class Shades {
public:
    Shades(const TreeGeometry& g, std::span<const Unorm16> luminance, bool textured)
        : luminance_(luminance), colours_(textured && !g.colours.empty() ? g.colours.data() : nullptr) {}

    PackedRange operator[](WedgeId wedge) const {
        return colours_ ? channel_range(colours_[wedge], luminance_[wedge])
                        : PackedRange{luminance_[wedge], luminance_[wedge]};
    }

private:
    std::span<const Unorm16> luminance_;
    const glm::vec4* colours_; // null where they do not matter
};

LeafSurroundings survey_leaves(const TreeGeometry& g, const TreeLinks& tree, const TreeParts& parts,
                               const Shades& shades) {
    const WedgeId first = tree.wedge_of_leaf(0);
    LeafSurroundings out;
    out.ring.assign(tree.leaves(), empty_range);
    out.areas.assign(tree.leaves(), 0.0);
    parts.for_each_triangle([&](const TreePart& part) {
        return [&](Index triangle) {
            const Triangle& t = g.triangles[triangle];
            const glm::dvec3 a = g.positions[first + t[0]], b = g.positions[first + t[1]],
                             c = g.positions[first + t[2]];
            const double area = glm::length(glm::cross(b - a, c - a)) / 6;
            PackedRange range = empty_range;
            for (const Index leaf : t) range = unite(range, shades[first + leaf]);
            for (const Index leaf : t) {
                if (!parts.owns_leaf(part, leaf)) continue;
                out.areas[leaf] += area;
                out.ring[leaf] = unite(out.ring[leaf], range);
            }
        };
    });
    for (Index leaf = 0; leaf < out.ring.size(); ++leaf) out.corners = unite(out.corners, shades[first + leaf]);
    return out;
}

// Area-weighted means over runs of leaves.
class RunningSums {
public:
    RunningSums(std::span<const double> areas, std::span<const Unorm16> luminance, const LeafRuns& runs)
        : runs_(runs), before_(areas.size() + 1) {
        double largest = 0;
        for (const double a : areas) largest = std::max(largest, a);
        const double scale = largest > 0 ? 1 / largest : 0;
        for (Index rank = 0; rank < areas.size(); ++rank) {
            const Index leaf = runs.leaf(rank);
            const double area = areas[leaf] * scale, y = luminance[leaf].value;
            const Sums& sums = before_[rank];
            before_[rank + 1] = {sums.area + area, sums.weighted + area * y, sums.plain + y};
        }
    }

    // In units of Unorm16.
    double mean(WedgeId wedge) const {
        const Index begin = runs_.begin(wedge), end = runs_.end(wedge);
        // Below this share of the largest vertex area, per leaf, the difference of two running sums is rounding noise.
        constexpr double least_mean_area = 1e-9;
        const Sums &first = before_[begin], &last = before_[end];
        const double area = last.area - first.area;
        if (area > least_mean_area * (end - begin)) return (last.weighted - first.weighted) / area;
        return (last.plain - first.plain) / (end - begin);
    }

private:
    struct Sums {
        double area = 0, weighted = 0, plain = 0;
    };
    const LeafRuns& runs_;
    std::vector<Sums> before_; // by leaf, in the order of the runs: over those before it
};

void light_leaves(const TreeGeometry& g, WedgeId first, const Light& light, bool prelit, bool textured,
                  std::span<Unorm16> luminance) {
    constexpr WedgeId grain = 4096; // leaves
    const WedgeId end = static_cast<WedgeId>(luminance.size());
    parallel_loop_over(tbb::blocked_range<WedgeId>(first, end, grain), [&](const auto& range) {
        for (WedgeId leaf = range.begin(); leaf < range.end(); ++leaf)
            luminance[leaf] = Unorm16::nearest(vertex_luminance(
                g.normals[leaf], g.colours.empty() ? nullptr : &g.colours[leaf], light, prelit, textured));
    });
}

void shade_by(const FunctionRef<float(WedgeId)>& given, std::span<Unorm16> luminance) {
    parallel_loop(WedgeId{0}, static_cast<WedgeId>(luminance.size()), [&](WedgeId wedge) {
        luminance[wedge] = Unorm16::nearest(std::min(1.0f, std::max(0.0f, given(wedge)))); // NaN: 0
    });
}

} // namespace

float vertex_luminance(glm::vec3 normal, const glm::vec4* colour, const Light& light, bool prelit, bool textured) {
    const float albedo = colour     ? std::clamp(rec709_luminance(glm::vec3(*colour)), 0.0f, 1.0f)
                         : textured ? 1.0f
                                    : default_albedo;
    if (prelit) return albedo;
    const float facing = glm::dot(normal, light.direction);
    const float lit = light.ambient + (1 - light.ambient) * std::max(facing, light.fill * -facing);
    // Unit vectors in floats may be a little long; an impossible light must not lead out of 0..1 either.
    return std::max(0.0f, std::min(1.0f, albedo * lit));
}

// Luminances and their ranges of interior nodes, from those of their children.
struct InteriorShader {
    const TreeGeometry& g;
    const TreeLinks& tree;
    const Shades& shades;
    const LeafSurroundings& leaf;
    const RunningSums& sums;
    bool has_given; // luminances of proxies are the caller's
    LuminanceArrays<Vector>& out;
    std::vector<PackedRange>& of_vertices; // the rings' ranges without the texture; empty without one
    std::span<const PackedRange> emission; // by node; empty: none

    void operator()(NodeId node) const {
        const bool textured = !of_vertices.empty();
        PackedRange support = empty_range, ring = empty_range;
        Unorm16 adaptation;
        tree.for_each_child(
            node,
            [&](NodeId child) {
                support = unite(support, out.support_range[child]);
                ring = unite(ring, textured ? of_vertices[child] : out.ring_range[child]);
                adaptation = std::max(adaptation, out.adaptation[child]);
            },
            [&](Index l) {
                support = unite(support, out.luminance[tree.wedge_of_leaf(l)]);
                ring = unite(ring, leaf.ring[l]);
            });
        const PackedRange below = support;
        for (WedgeId w = tree.first_wedge_of(node); w < tree.first_wedge_of(node + 1); ++w) {
            // The mean lies within the leaves' range except for rounding.
            if (!has_given)
                out.luminance[w] = std::clamp(Unorm16::nearest(sums.mean(w) / Unorm16::largest), below.lo, below.hi);
            support = unite(support, out.luminance[w]);
            ring = unite(ring, shades[w]);
        }
        out.support_range[node] = support;
        if (textured) {
            of_vertices[node] = ring;
            ring = product(ring, g.ring_texture[node]);
            if (!emission.empty()) ring = sum(ring, emission[node]);
        }
        out.ring_range[node] = ring;
        out.adaptation[node] = std::max(adaptation, middle(ring));
    }
};

TreeLuminance derive_luminance(const TreeGeometry& g, const TreeParts& parts, const Light& light, bool prelit,
                               bool textured, const FunctionRef<float(WedgeId)>* given) {
    textured = textured && !g.texels.empty();
    const TreeLinks tree = links_of(g);
    const NodeId interior = tree.interior();
    LuminanceArrays<Vector> out;
    out.luminance.resize(g.positions.size());
    out.support_range.resize(interior);
    out.ring_range.resize(interior);
    out.adaptation.resize(interior);

    const WedgeId first = tree.wedge_of_leaf(0);
    if (given) shade_by(*given, out.luminance);
    else light_leaves(g, first, light, prelit, textured, out.luminance);
    const Shades shades(g, out.luminance, textured);
    const LeafSurroundings leaf = survey_leaves(g, tree, parts, shades);
    // A proxy's luminance is the area-weighted mean of its leaves: folds keep the mean of their surroundings.
    const LeafRuns runs(tree);
    const RunningSums sums(leaf.areas, std::span(out.luminance).subspan(first), runs);

    std::vector<PackedRange> of_vertices(textured ? interior : 0);
    const auto emission = textured && !g.emission.empty() ? bound_ring_emission(g, parts) : std::vector<PackedRange>();
    const InteriorShader shade{g, tree, shades, leaf, sums, given != nullptr, out, of_vertices, emission};
    parts.bottom_up([&] { return [&](NodeId node) { shade(node); }; });

    PackedRange drawn = leaf.corners;
    if (given) drawn = unite(drawn, out.support_range[VertexTree::root()]); // proxies may go beyond
    if (textured) drawn = product(drawn, g.ring_texture[VertexTree::root()]);
    if (!emission.empty()) drawn = sum(drawn, emission[VertexTree::root()]);
    return {
        {std::move(out.luminance), std::move(out.support_range), std::move(out.ring_range), std::move(out.adaptation)},
        light,
        prelit,
        textured,
        drawn};
}

TreeLuminance copy_of(const TreeLuminance& light) {
    const auto copy = [](const auto& values) { return std::vector(values.begin(), values.end()); };
    return {{copy(light.luminance), copy(light.support_range), copy(light.ring_range), copy(light.adaptation)},
            light.light,
            light.prelit,
            light.textured,
            light.range};
}

VertexTree::VertexTree(std::shared_ptr<const Data> data) : data_(std::move(data)), checks_(data_->checks.get()) {
    const TreeGeometry& g = *data_->geometry;
    links_ = {{{g.several, g.extra_wedges, g.further, g.leaf_ranks, g.wedge_ranks},
               g.parents,
               g.first_leaf,
               g.leaf_end,
               g.subtree_end},
              {g.needing, g.first_need, g.needs},
              g.first_triangle,
              g.triangles};
    is_locked_ = !g.fold_weights.empty() && std::isinf(g.fold_weights[root()]);
    if (!is_locked_) return;
    std::vector<std::uint64_t> locked(words_for(interior_count()));
    set_bit(locked, root());
    locked_triangles_ = links_.triangles_of(root());
    NeedCloser(*this).close(locked, [&](NodeId node) { locked_triangles_ += links_.triangles_of(node); });
}
VertexTree::VertexTree(VertexTree&&) noexcept = default;
VertexTree& VertexTree::operator=(VertexTree&&) noexcept = default;
VertexTree::~VertexTree() = default;

glm::dvec3 VertexTree::origin() const noexcept { return data_->geometry->origin; }
std::span<const glm::vec3> VertexTree::positions() const noexcept { return data_->geometry->positions; }
std::span<const Unorm16> VertexTree::luminance() const noexcept { return data_->light->luminance; }
std::span<const PackedNormal> VertexTree::normals() const noexcept { return data_->geometry->normals; }
std::span<const glm::vec4> VertexTree::colours() const noexcept { return data_->geometry->colours; }
std::span<const glm::vec2> VertexTree::uvs() const noexcept { return data_->geometry->uvs; }

TextureView VertexTree::texture() const noexcept {
    return data_->light->textured ? data_->geometry->texture_view() : TextureView{};
}

std::span<const NodeBounds> VertexTree::bounds() const noexcept { return data_->geometry->bounds; }
NormalMask VertexTree::mask(NodeId node) const noexcept {
    return unpack_mask(data_->geometry->mask_records, data_->geometry->mask_at[node]);
}
std::span<const Sphere> VertexTree::support_spheres() const noexcept { return data_->geometry->support_spheres; }
std::span<const PackedRange> VertexTree::support_luminance() const noexcept { return data_->light->support_range; }
std::span<const PackedRange> VertexTree::ring_luminance() const noexcept { return data_->light->ring_range; }
std::span<const PackedRange> VertexTree::ring_texture() const noexcept {
    return data_->light->textured ? std::span<const PackedRange>(data_->geometry->ring_texture)
                                  : std::span<const PackedRange>();
}
std::span<const Unorm16> VertexTree::adaptation_luminance() const noexcept { return data_->light->adaptation; }
std::span<const float> VertexTree::displacement() const noexcept { return data_->geometry->displacement; }
std::span<const float> VertexTree::fold_weights() const noexcept { return data_->geometry->fold_weights; }

std::span<const Index> VertexTree::source_vertices() const noexcept { return data_->geometry->source_vertices; }
Index VertexTree::source_vertex_count() const noexcept { return data_->geometry->source_vertex_count; }
std::span<const Index> VertexTree::source_triangles() const noexcept { return data_->geometry->source_triangles; }
std::span<const MeshRange> VertexTree::ranges() const noexcept { return data_->geometry->ranges; }
std::span<const std::byte> VertexTree::document() const noexcept { return data_->geometry->document; }
std::uint64_t VertexTree::dropped_triangles() const noexcept { return data_->geometry->dropped_triangles; }
Closedness VertexTree::closedness() const noexcept { return data_->geometry->closedness; }
const Creases& VertexTree::creases() const noexcept { return data_->geometry->creases; }
Sphere VertexTree::bounding_sphere() const noexcept { return data_->geometry->bounding_sphere; }
LuminanceRange VertexTree::luminance_range() const noexcept { return data_->light->range; }

const Light& VertexTree::light() const noexcept { return data_->light->light; }
bool VertexTree::is_prelit() const noexcept { return data_->light->prelit; }

bool VertexTree::looks_sound(NodeId node) const { return checks_->is_sound(node); }

Result<void> VertexTree::check() const { return checks_ ? checks_->check_all() : Result<void>(); }

Result<SoundTree> SoundTree::of(const VertexTree& tree) {
    if (const auto sound = tree.check(); !sound) return sound.error();
    return SoundTree(tree.share());
}

namespace {

// A tree whose luminance is found anew. There is nothing left to check.
Result<VertexTree> shaded_anew(const VertexTree& tree, const Light& light, bool prelit, bool textured,
                               const FunctionRef<float(WedgeId)>* given = nullptr) {
    const auto sound = SoundTree::of(tree);
    if (!sound) return sound.error();
    auto data = std::make_shared<VertexTree::Data>();
    data->geometry = tree.data().geometry;
    TreeParts parts(links_of(*data->geometry));
    parts.assign_triangles(sound->first_triangle(), sound->triangles());
    data->light =
        std::make_shared<TreeLuminance>(derive_luminance(*data->geometry, parts, light, prelit, textured, given));
    return VertexTree(std::move(data));
}

} // namespace

Result<VertexTree> VertexTree::relit(const Light& light) const {
    return shaded_anew(*this, light, false, data_->light->textured);
}

Result<VertexTree> VertexTree::shaded(const FunctionRef<float(WedgeId)>& luminance, bool keeps_texture) const {
    return shaded_anew(*this, light(), true, keeps_texture && data_->light->textured, &luminance);
}

Result<VertexTree> VertexTree::untextured() const {
    return shaded_anew(*this, light(), is_prelit() && !colours().empty(), false);
}

std::string fault_in_attribute(const Attribute& a, std::size_t interior_count, std::size_t node_count) {
    const auto is_plain = [](char c) { return c > ' ' && c <= '~'; };
    if (a.name.empty() || a.name.size() > longest_attribute_name ||
        !std::all_of(a.name.begin(), a.name.end(), is_plain))
        return "An attribute's name must have 1 to 20 printable characters and no spaces.";
    const std::uint32_t component = a.component_bytes;
    if (!(component == 1 || component == 2 || component == 4 || component == 8) || a.element_bytes == 0 ||
        a.element_bytes % component != 0)
        return "Attribute " + a.name + " has values that are no numbers of 1, 2, 4 or 8 bytes.";
    if (a.domain == AttributeDomain::tree) return {};
    if (a.domain != AttributeDomain::interior_node && a.domain != AttributeDomain::node)
        return "Attribute " + a.name + " is of nothing that a tree has.";
    if (a.count == (a.domain == AttributeDomain::node ? node_count : interior_count)) return {};
    return "Attribute " + a.name + " has " + std::to_string(a.count) + " values, not one for each node.";
}

std::span<const std::byte> VertexTree::attribute_bytes(std::string_view name, std::size_t element,
                                                       std::uint32_t component) const noexcept {
    for (const Attribute& a : data_->attributes)
        if (a.name == name && a.element_bytes == element && a.component_bytes == component) return a.bytes;
    return {};
}

std::span<const Attribute> VertexTree::attributes() const noexcept { return data_->attributes; }

Result<VertexTree> VertexTree::with_attribute(Attribute attribute) const {
    if (const std::string fault = fault_in_attribute(attribute, interior_count(), node_count()); !fault.empty())
        return invalid_argument(fault);
    auto data = std::make_shared<Data>(*data_);
    std::erase_if(data->attributes, [&](const Attribute& a) { return a.name == attribute.name; });
    if (data->attributes.size() == most_attributes)
        return invalid_argument("A tree has at most " + std::to_string(most_attributes) +
                                " attributes; there is no room for " + attribute.name + ".");
    data->attributes.push_back(std::move(attribute));
    return VertexTree(std::move(data));
}

std::uint64_t VertexTree::byte_size() const noexcept {
    std::uint64_t attributes = 0;
    for (const Attribute& a : data_->attributes) attributes += a.bytes.size();
    const auto bytes_of = [](const auto&... arrays) { return (std::uint64_t{arrays.bytes()} + ...); };
    const TreeGeometry& g = *data_->geometry;
    const TreeLuminance& l = *data_->light;
    return attributes + g.ranges.capacity() * sizeof(MeshRange) +
           bytes_of(g.parents, g.several, g.extra_wedges, g.further, g.leaf_ranks, g.wedge_ranks, g.needing,
                    g.first_need, g.needs, g.positions, g.normals, g.colours, g.uvs, g.first_leaf, g.leaf_end,
                    g.subtree_end, g.first_triangle, g.bounds, g.support_spheres, g.mask_at, g.mask_records,
                    g.displacement, g.fold_weights, g.locked_positions, g.triangles, g.source_triangles,
                    g.source_vertices, g.document, g.texels, g.emission, g.relief, g.ring_texture) +
           bytes_of(l.luminance, l.support_range, l.ring_range, l.adaptation);
}

} // namespace unseen::vdtree
