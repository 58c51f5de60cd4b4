#include <unseen/vdtree/vertex_tree.h>

#include <glm/geometric.hpp>

#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/texture_bounds.h>

#include "tree/mask_pool.h"
#include "tree/node_check.h"

namespace unseen::vdtree {

namespace {

PackedRange unite(PackedRange a, Unorm16 y) { return unite(a, PackedRange{y, y}); }

// Rounded up: eyes adapted to more light see no less.
Unorm16 middle(PackedRange r) { return {static_cast<std::uint16_t>((r.lo.value + r.hi.value + 1) / 2)}; }

// The range of the same length as `spread` that begins where `ring` does, within `ring`.
PackedRange shortened(PackedRange ring, PackedRange spread) {
    const int hi = ring.lo.value + (spread.hi.value - spread.lo.value);
    return {ring.lo, {static_cast<std::uint16_t>(std::min<int>(ring.hi.value, hi))}};
}

// By leaf: the luminance of the triangles around it (of itself without any), and a third of their area, in double against
// overflow at extreme scales. And the luminance of all corners.
struct LeafSurroundings {
    std::vector<PackedRange> ring;
    std::vector<double> areas;
    PackedRange corners = empty_range;
};

// By node: what the texture is multiplied with, over the three channels of colour; for others, the luminance alone.
class Shades {
public:
    Shades(const TreeGeometry& g, std::span<const Unorm16> luminance, bool textured)
        : luminance_(luminance), colours_(textured && !g.colours.empty() ? g.colours.data() : nullptr) {}

    PackedRange operator[](NodeId node) const {
        return colours_ ? channel_range(colours_[node], luminance_[node])
                        : PackedRange{luminance_[node], luminance_[node]};
    }

private:
    std::span<const Unorm16> luminance_;
    const glm::vec4* colours_; // null where they do not matter
};

LeafSurroundings survey_leaves(const TreeGeometry& g, const TreeParts& parts, const Shades& shades) {
    const NodeId interior = static_cast<NodeId>(g.first_leaf.size());
    LeafSurroundings out;
    out.ring.assign(g.leaf_end[0], empty_range);
    out.areas.assign(g.leaf_end[0], 0.0);
    parts.for_each_triangle([&](const TreePart& part) {
        return [&](Index triangle) {
            const Triangle& t = g.triangles[triangle];
            const glm::dvec3 a = g.positions[interior + t[0]], b = g.positions[interior + t[1]],
                             c = g.positions[interior + t[2]];
            const double area = glm::length(glm::cross(b - a, c - a)) / 6;
            PackedRange range = empty_range;
            for (const Index leaf : t) range = unite(range, shades[interior + leaf]);
            for (const Index leaf : t) {
                if (!parts.owns_leaf(part, leaf)) continue;
                out.areas[leaf] += area;
                out.ring[leaf] = unite(out.ring[leaf], range);
            }
        };
    });
    for (Index leaf = 0; leaf < out.ring.size(); ++leaf) {
        if (out.ring[leaf] == empty_range) out.ring[leaf] = shades[interior + leaf];
        else out.corners = unite(out.corners, shades[interior + leaf]);
    }
    return out;
}

// Area-weighted means over ranges of leaves.
class RunningSums {
public:
    RunningSums(std::span<const double> areas, std::span<const Unorm16> luminance) : before_(areas.size() + 1) {
        double largest = 0;
        for (const double a : areas) largest = std::max(largest, a);
        const double scale = largest > 0 ? 1 / largest : 0;
        for (std::size_t leaf = 0; leaf < areas.size(); ++leaf) {
            const double area = areas[leaf] * scale, y = luminance[leaf].value;
            const Sums& sums = before_[leaf];
            before_[leaf + 1] = {sums.area + area, sums.weighted + area * y, sums.plain + y};
        }
    }

    // In units of Unorm16.
    double mean(Index begin, Index end) const {
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
    std::vector<Sums> before_; // by leaf: over those before it
};

void light_leaves(const TreeGeometry& g, const Light& light, bool prelit, bool textured, std::span<Unorm16> luminance) {
    constexpr NodeId grain = 4096; // leaves
    const NodeId interior = static_cast<NodeId>(g.first_leaf.size()), nodes = static_cast<NodeId>(luminance.size());
    parallel_loop_over(tbb::blocked_range<NodeId>(interior, nodes, grain), [&](const auto& range) {
        for (NodeId node = range.begin(); node < range.end(); ++node)
            luminance[node] = Unorm16::nearest(vertex_luminance(
                g.normals[node], g.colours.empty() ? nullptr : &g.colours[node], light, prelit, textured));
    });
}

void shade_by(const FunctionRef<float(NodeId)>& given, std::span<Unorm16> luminance) {
    parallel_loop(NodeId{0}, static_cast<NodeId>(luminance.size()), [&](NodeId node) {
        luminance[node] = Unorm16::nearest(std::min(1.0f, std::max(0.0f, given(node)))); // NaN: 0
    });
}

// What a node and all below it are multiplied with, or show.
PackedRange range_below(const TreeGeometry& g, const Shades& shades, NodeId node) {
    const NodeId interior = static_cast<NodeId>(g.first_leaf.size());
    PackedRange range = empty_range;
    for (NodeId below = node; below < g.subtree_end[node]; ++below) range = unite(range, shades[below]);
    for (Index leaf = g.first_leaf[node]; leaf < g.leaf_end[node]; ++leaf)
        range = unite(range, shades[interior + leaf]);
    return range;
}

// Whether all leaves of a node lie at one point, its proxy's: then folding it moves nothing.
bool is_coincident(const TreeGeometry& g, NodeId node) { return g.support_spheres[node].radius == 0; }

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
    std::span<const std::uint8_t> moves_texture; // by node; empty without a texture
    bool has_given;                              // luminances of proxies are the caller's
    LuminanceArrays<Vector>& out;
    std::vector<PackedRange>& of_vertices; // the rings' ranges without the texture; empty without one

    struct Ranges {
        PackedRange support = empty_range, ring = empty_range;
        // Rings of coincident children, which may be several nodes deep, as they are stored: shortened.
        PackedRange shortened_rings = empty_range, shortened_vertices = empty_range;
        Unorm16 adaptation;
    };

    Ranges collect(NodeId node) const {
        const bool textured = !of_vertices.empty();
        Ranges all;
        tree.for_each_child(
            node,
            [&](NodeId child) {
                all.support = unite(all.support, out.support_range[child]);
                all.ring = unite(all.ring, textured ? of_vertices[child] : out.ring_range[child]);
                if (is_coincident(g, child)) { // its ring_range is narrower than its ring
                    for (Index l = g.first_leaf[child]; l < g.leaf_end[child]; ++l)
                        all.ring = unite(all.ring, leaf.ring[l]);
                    all.shortened_rings = unite(all.shortened_rings, out.ring_range[child]);
                    if (textured) all.shortened_vertices = unite(all.shortened_vertices, of_vertices[child]);
                }
                all.adaptation = std::max(all.adaptation, out.adaptation[child]);
            },
            [&](Index l) {
                all.support = unite(all.support, out.luminance[tree.interior() + l]);
                all.ring = unite(all.ring, leaf.ring[l]);
            });
        return all;
    }

    void operator()(NodeId node) const {
        const bool textured = !of_vertices.empty();
        auto [support, ring, shortened_rings, shortened_vertices, adaptation] = collect(node);
        // The mean lies within the leaves' range except for rounding.
        const double mean = sums.mean(g.first_leaf[node], g.leaf_end[node]);
        const Unorm16 y = has_given ? out.luminance[node]
                                    : std::clamp(Unorm16::nearest(mean / Unorm16::largest), support.lo, support.hi);
        out.luminance[node] = y;
        support = unite(support, y);
        ring = unite(ring, shades[node]);
        if (is_coincident(g, node) && !(textured && moves_texture[node])) {
            // Nothing moves; a pixel of the ring changes by the spread of the coincident vertices at most. The contrast
            // of that is largest on the ring's darkest luminance.
            ring = shortened(ring, textured ? unite(support, range_below(g, shades, node)) : support);
            ring = unite(ring, textured ? shortened_vertices : shortened_rings);
        }
        out.support_range[node] = support;
        if (textured) {
            of_vertices[node] = ring;
            PackedRange texture = g.ring_texture[node];
            if (is_coincident(g, node) && !moves_texture[node])
                texture.lo = texture.hi; // the brightest shows the spread best
            ring = unite(product(ring, texture), shortened_rings);
        }
        out.ring_range[node] = ring;
        out.adaptation[node] = std::max(adaptation, middle(ring));
    }
};

TreeLuminance derive_luminance(const TreeGeometry& g, const TreeParts& parts, const Light& light, bool prelit,
                               bool textured, const FunctionRef<float(NodeId)>* given) {
    textured = textured && !g.texels.empty();
    const TreeLinks tree = links_of(g);
    const NodeId interior = tree.interior();
    LuminanceArrays<Vector> out;
    out.luminance.resize(g.parents.size());
    out.support_range.resize(interior);
    out.ring_range.resize(interior);
    out.adaptation.resize(interior);

    if (given) shade_by(*given, out.luminance);
    else light_leaves(g, light, prelit, textured, out.luminance);
    const Shades shades(g, out.luminance, textured);
    const LeafSurroundings leaf = survey_leaves(g, parts, shades);
    // A proxy's luminance is the area-weighted mean of its leaves: folds keep the mean of their surroundings.
    const RunningSums sums(leaf.areas, std::span(out.luminance).subspan(interior));

    std::vector<PackedRange> of_vertices(textured ? interior : 0);
    const std::vector<std::uint8_t> moves_texture =
        textured ? find_texture_moves(g, parts) : std::vector<std::uint8_t>();
    const InteriorShader shade{g, tree, shades, leaf, sums, moves_texture, given != nullptr, out, of_vertices};
    parts.bottom_up([&] { return [&](NodeId node) { shade(node); }; });

    PackedRange drawn = leaf.corners;
    if (given && interior > 0) drawn = unite(drawn, out.support_range[VertexTree::root()]); // proxies may go beyond
    return {
        {std::move(out.luminance), std::move(out.support_range), std::move(out.ring_range), std::move(out.adaptation)},
        light,
        prelit,
        textured,
        textured ? product(drawn, g.ring_texture[VertexTree::root()]) : drawn};
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
    links_ = {g.parents, g.subtree_end, g.first_leaf, g.leaf_end, g.first_triangle, g.triangles};
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

std::span<const Index> VertexTree::source_vertices() const noexcept { return data_->geometry->source_vertices; }
std::span<const Index> VertexTree::source_triangles() const noexcept { return data_->geometry->source_triangles; }
std::span<const MeshRange> VertexTree::ranges() const noexcept { return data_->geometry->ranges; }
std::span<const std::byte> VertexTree::document() const noexcept { return data_->geometry->document; }
std::uint64_t VertexTree::dropped_triangles() const noexcept { return data_->geometry->dropped_triangles; }
Closedness VertexTree::closedness() const noexcept { return data_->geometry->closedness; }
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
                               const FunctionRef<float(NodeId)>* given = nullptr) {
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

Result<VertexTree> VertexTree::shaded(const FunctionRef<float(NodeId)>& luminance, bool keeps_texture) const {
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
           bytes_of(g.parents, g.positions, g.normals, g.colours, g.uvs, g.first_leaf, g.leaf_end, g.subtree_end,
                    g.first_triangle, g.bounds, g.support_spheres, g.mask_at, g.mask_records, g.displacement,
                    g.triangles, g.source_triangles, g.source_vertices, g.document, g.texels, g.ring_texture) +
           bytes_of(l.luminance, l.support_range, l.ring_range, l.adaptation);
}

} // namespace unseen::vdtree
