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
    const NodeId interior = tree.interior();
    std::vector<UvBox> around(tree.leaves()), boxes(interior);
    for (Index leaf = 0; leaf < tree.leaves(); ++leaf) around[leaf].include(g.uvs[interior + leaf]);
    parts.for_each_triangle([&](const TreePart& part) {
        return [&](Index triangle) {
            const Triangle& t = g.triangles[triangle];
            UvBox box;
            for (const Index leaf : t) box.include(g.uvs[interior + leaf]);
            for (const Index leaf : t)
                if (parts.owns_leaf(part, leaf)) around[leaf].include(box);
        };
    });
    parts.bottom_up([&] {
        return [&](NodeId node) {
            UvBox box;
            box.include(g.uvs[node]);
            tree.for_each_child(
                node, [&](NodeId child) { box.include(boxes[child]); }, [&](Index leaf) { box.include(around[leaf]); });
            boxes[node] = box;
        };
    });
    return boxes;
}

std::vector<PackedRange> bound_ring_texture(const TreeGeometry& g, const TreeParts& parts) {
    const std::vector<UvBox> boxes = bound_footprints(g, parts);
    const TexturePyramid pyramid(g.texture_view());
    std::vector<PackedRange> ranges(boxes.size());
    parallel_loop(std::size_t{0}, boxes.size(), [&](std::size_t node) { ranges[node] = pyramid.range(boxes[node]); });
    return ranges;
}

std::vector<std::uint8_t> find_texture_moves(const TreeGeometry& g, const TreeParts& parts) {
    const TreeLinks tree = links_of(g);
    std::vector<std::uint8_t> moves(tree.interior(), 0);
    parts.bottom_up([&] {
        return [&](NodeId node) {
            const glm::vec2 here = g.uvs[node];
            bool differs = false;
            tree.for_each_child(
                node, [&](NodeId child) { differs = differs || moves[child] || g.uvs[child] != here; },
                [&](Index leaf) { differs = differs || g.uvs[tree.node_of_leaf(leaf)] != here; });
            moves[node] = differs;
        };
    });
    return moves;
}

} // namespace unseen::vdtree
