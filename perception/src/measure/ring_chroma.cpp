#include <unseen/perception/internal/chroma.h>

#include <algorithm>
#include <optional>

#include <glm/geometric.hpp>

#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/texture_pyramid.h>
#include <unseen/vdtree/internal/tree_parts.h>
#include <unseen/vdtree/internal/vertex_tree_data.h>

namespace unseen::perception {

using namespace vdtree;

namespace {

// In relative luminance: a hundredth of the least contrast of colour that eyes can see, and above the rounding of
// greys.
constexpr float grey_slack = 1e-5f;
// Pure blue as bright as white has 11: whatever is beyond comes from impossible colours.
constexpr double most_chroma = 100;

} // namespace

bool has_colours(const VertexTree& tree) {
    constexpr int alike = 2; // codes
    const auto is_grey = [](const Texel& t) {
        const auto [least, most] = std::minmax({t[0], t[1], t[2]});
        return most - least <= alike;
    };
    const TextureView texture = tree.texture();
    return has_chroma(tree) || !std::ranges::all_of(texture.texels, is_grey) ||
           !std::ranges::all_of(texture.emission, is_grey);
}

glm::vec3 drawn_colour(const glm::vec4& colour, float luminance) {
    const glm::dvec3 rgb(colour);
    const double own = rec709_luminance(rgb);
    if (!(own > 0)) return glm::vec3(luminance);
    const glm::vec3 drawn(rgb * (static_cast<double>(luminance) / own));
    return glm::clamp(drawn, -static_cast<float>(most_chroma), static_cast<float>(most_chroma));
}

glm::vec2 drawn_chroma(const glm::vec4& colour, float luminance) {
    const glm::dvec3 rgb(colour);
    const double own = rec709_luminance(rgb);
    if (!(own > 0)) return glm::vec2(0); // drawn grey
    const glm::dvec2 chroma = opponent_chroma(rgb) * (static_cast<double>(luminance) / own);
    const auto bounded = [](double c) {
        return static_cast<float>(c > -most_chroma ? std::min(c, most_chroma) : -most_chroma);
    };
    return {bounded(chroma.x), bounded(chroma.y)};
}

bool has_chroma(const VertexTree& tree) {
    const auto colours = tree.colours();
    const auto luminance = tree.luminance();
    for (std::size_t wedge = 0; wedge < colours.size(); ++wedge) {
        const glm::vec2 chroma = drawn_chroma(colours[wedge], luminance[wedge]);
        if (!(std::max(std::abs(chroma.x), std::abs(chroma.y)) <= grey_slack)) return true;
    }
    return false;
}

ChromaRange colour_reach(const VertexTree& tree) {
    ChromaRange all;
    const auto include = [&](glm::vec2 chroma) { all = unite(all, {chroma, chroma}); };
    const auto colours = tree.colours();
    for (std::size_t wedge = 0; wedge < colours.size(); ++wedge)
        include(drawn_chroma(colours[wedge], tree.luminance()[wedge]));
    const auto include_texels = [&](std::span<const Texel> texels, float brightest) {
        std::optional<Texel> last; // neighbours are often alike
        for (const Texel& texel : texels) {
            if (last == texel || (texel[0] == texel[1] && texel[0] == texel[2])) continue;
            last = texel;
            include(brightest * glm::vec2(opponent_chroma(glm::dvec3(linear_colour(texel)))));
        }
    };
    include_texels(tree.texture().texels, tree.luminance_range().hi);
    include_texels(tree.texture().emission, 1);
    return all;
}

Result<std::vector<ChromaRange>> ring_chroma(const VertexTree& given) {
    const auto sound = SoundTree::of(given);
    if (!sound) return sound.error();
    if (!has_chroma(given)) return std::vector<ChromaRange>();
    const TreeGeometry& g = *given.data().geometry;
    const std::span<const Unorm16> luminance = given.luminance();
    TreeParts parts(links_of(g));
    parts.assign_triangles(sound->first_triangle(), sound->triangles());
    const TreeLinks tree = links_of(g);
    const WedgeId leaves = tree.wedge_of_leaf(0);
    std::vector<glm::vec2> chroma(luminance.size()); // by wedge
    constexpr std::size_t grain = 4096;
    parallel_loop_over(tbb::blocked_range<std::size_t>(0, chroma.size(), grain), [&](const auto& range) {
        for (std::size_t wedge = range.begin(); wedge < range.end(); ++wedge)
            chroma[wedge] = drawn_chroma(g.colours[wedge], luminance[wedge]);
    });

    const auto of_leaf = [&](Index leaf) { return ChromaRange{chroma[leaves + leaf], chroma[leaves + leaf]}; };
    std::vector<ChromaRange> around(tree.leaves());
    for (Index leaf = 0; leaf < tree.leaves(); ++leaf) around[leaf] = of_leaf(leaf);
    parts.for_each_triangle([&](const TreePart& part) {
        return [&](Index triangle) {
            const Triangle& t = g.triangles[triangle];
            ChromaRange range = of_leaf(t[0]);
            for (const Index leaf : t) range = unite(range, of_leaf(leaf));
            for (const Index leaf : t)
                if (parts.owns_leaf(part, leaf)) around[leaf] = unite(around[leaf], range);
        };
    });
    std::vector<ChromaRange> ring(tree.interior());
    parts.bottom_up([&] {
        return [&](NodeId node) {
            const WedgeId first = tree.first_wedge_of(node), end = tree.first_wedge_of(node + 1);
            ChromaRange range{chroma[first], chroma[first]};
            for (WedgeId wedge = first + 1; wedge < end; ++wedge) range = unite(range, {chroma[wedge], chroma[wedge]});
            tree.for_each_child(
                node, [&](NodeId child) { range = unite(range, ring[child]); },
                [&](Index leaf) { range = unite(range, around[leaf]); });
            ring[node] = range;
        };
    });
    return ring;
}

} // namespace unseen::perception
