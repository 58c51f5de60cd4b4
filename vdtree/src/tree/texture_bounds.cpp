#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/texture_bounds.h>

#include <algorithm>

namespace unseen::vdtree {

namespace {

constexpr double largest = Unorm16::largest;

Unorm16 down(double units) { return {static_cast<std::uint16_t>(std::clamp(std::floor(units), 0.0, largest))}; }
Unorm16 up(double units) { return {static_cast<std::uint16_t>(std::clamp(std::ceil(units), 0.0, largest))}; }

} // namespace

PackedRange product(PackedRange luminance, PackedRange texture) {
    return {down(luminance.lo.value * (texture.lo.value / largest)),
            up(luminance.hi.value * (texture.hi.value / largest))};
}

PackedRange channel_range(const glm::vec4& colour, Unorm16 luminance) {
    const glm::dvec3 rgb(colour);
    const double own = rec709_luminance(rgb);
    if (!(own > 0)) return {luminance, luminance}; // drawn grey
    const double least = std::min({rgb.r, rgb.g, rgb.b}) / own, most = std::max({rgb.r, rgb.g, rgb.b}) / own;
    return {std::min(down(luminance.value * least), luminance), std::max(up(luminance.value * most), luminance)};
}

std::vector<UvBox> bound_footprints(const TreeGeometry& g, const TreeParts& parts) {
    const TreeLinks tree = links_of(g);
    const WedgeId first = tree.wedge_of_leaf(0);
    std::vector<UvBox> around(tree.leaves()), boxes(first);
    for (Index leaf = 0; leaf < tree.leaves(); ++leaf) around[leaf].include(g.uvs[first + leaf]);
    parts.for_each_triangle([&](const TreePart& part) {
        return [&](Index triangle) {
            const Triangle& t = g.triangles[triangle];
            UvBox box;
            for (const Index leaf : t) box.include(g.uvs[first + leaf]);
            for (const Index leaf : t)
                if (parts.owns_leaf(part, leaf)) around[leaf].include(box);
        };
    });
    parts.bottom_up([&] {
        return [&](NodeId node) {
            for (WedgeId w = tree.first_wedge_of(node); w < tree.first_wedge_of(node + 1); ++w)
                boxes[w].include(g.uvs[w]);
            tree.for_each_child(
                node,
                [&](NodeId child) {
                    for (WedgeId w = tree.first_wedge_of(child); w < tree.first_wedge_of(child + 1); ++w)
                        boxes[tree.wedge_above(node, w)].include(boxes[w]);
                },
                [&](Index leaf) { boxes[tree.wedge_above(node, first + leaf)].include(around[leaf]); });
        };
    });
    return boxes;
}

PackedRange sum(PackedRange a, PackedRange b) {
    return {down(double{0} + a.lo.value + b.lo.value), up(double{0} + a.hi.value + b.hi.value)};
}

namespace {

std::vector<PackedRange> bound_ring_map(const TreeGeometry& g, const TreeParts& parts, const TextureView& map) {
    const TreeLinks tree = links_of(g);
    const std::vector<UvBox> boxes = bound_footprints(g, parts);
    const TexturePyramid pyramid(map);
    std::vector<PackedRange> ranges(tree.interior(), empty_range);
    parallel_loop(std::size_t{0}, ranges.size(), [&](std::size_t i) {
        const NodeId node = static_cast<NodeId>(i);
        for (WedgeId w = tree.first_wedge_of(node); w < tree.first_wedge_of(node + 1); ++w)
            ranges[node] = unite(ranges[node], pyramid.range(boxes[w]));
    });
    // Pyramids may find a little less for a larger box: what grows up the tree is made to.
    for (NodeId node = tree.interior(); node-- > 1;)
        ranges[tree.parents[node]] = unite(ranges[tree.parents[node]], ranges[node]);
    return ranges;
}

} // namespace

std::vector<PackedRange> bound_ring_texture(const TreeGeometry& g, const TreeParts& parts) {
    return bound_ring_map(g, parts, g.texture_view());
}

std::vector<PackedRange> bound_ring_emission(const TreeGeometry& g, const TreeParts& parts) {
    return bound_ring_map(g, parts, g.emission_view());
}

} // namespace unseen::vdtree
