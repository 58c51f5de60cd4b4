// What rings of textured trees can show in any cut.
#include <unseen/perception/internal/cut_rings.h>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/internal/texture_pyramid.h>
#include <unseen/vdtree/mesh.h>

#include "built.h"
#include "shapes.h"
#include "sound.h"
#include "testing.h"
#include "textures.h"

namespace unseen::perception {

using namespace vdtree;

namespace textured_rings_test {

using support::built;

// Triangles of any cut show, anywhere, what the ring of their largest node says; and where they show one place of the
// texture, they are as near to each other as it says.
TEST(TexturedRings, BoundTheRingsOfAllCuts) {
    std::mt19937_64 random(17);
    int looked = 0;
    for (int which = 0; which < 10; ++which) {
        const Mesh mesh = textures::textured_cases(which % 5);
        const VertexTree tree = built(mesh, {.prelit = which < 5});
        const CutRings rings = *bound_cut_rings(tree);
        const auto is_larger = [&](NodeId a, NodeId b) {
            const float ra = tree.support_spheres()[a].radius, rb = tree.support_spheres()[b].radius;
            return ra != rb ? ra > rb : a < b;
        };
        for (int trial = 0; trial < 30; ++trial) {
            const double keep = shapes::random_unit(random);
            std::vector<float> costs(tree.interior_count());
            for (NodeId node = 0; node < costs.size(); ++node)
                costs[node] = (node == 0 || costs[support::sound(tree).parents()[node]] > 1) &&
                                      shapes::random_unit(random) < 1 - keep / 20
                                  ? 2.0f
                                  : 0.0f;
            Cut cut(tree);
            cut.adjust([&](const VertexTree&, std::span<const NodeId> nodes, std::span<float> out) {
                for (std::size_t i = 0; i < nodes.size(); ++i) out[i] = costs[nodes[i]];
            });
            const auto indices = cut.indices();
            for (std::size_t i = 0; i < indices.size(); i += 3) {
                NodeId largest = no_node;
                for (std::size_t k = 0; k < 3; ++k)
                    if (const NodeId node = support::node_of(tree, indices[i + k]);
                        !tree.is_place(node) && (largest == no_node || is_larger(node, largest)))
                        largest = node;
                if (largest == no_node) continue;
                for (int k = 0; k < 4; ++k) {
                    double a = shapes::random_unit(random), b = shapes::random_unit(random);
                    if (a + b > 1) a = 1 - a, b = 1 - b;
                    const std::array<double, 3> weights = {1 - a - b, a, b};
                    glm::dvec2 uv(0);
                    glm::dvec3 rgb(0);
                    for (std::size_t c = 0; c < 3; ++c) {
                        const WedgeId wedge = indices[i + c];
                        uv += weights[c] * glm::dvec2(tree.uvs()[wedge]);
                        const double y = tree.luminance()[wedge];
                        glm::dvec3 shade(y);
                        if (!tree.colours().empty()) {
                            const glm::dvec3 colour(tree.colours()[wedge]);
                            shade = colour * (y / (0.2126 * colour.r + 0.7152 * colour.g + 0.0722 * colour.b));
                        }
                        rgb += weights[c] * shade;
                    }
                    // The texel there, for noise's texels differ in all channels.
                    const auto at = [&](double x, std::uint32_t n) {
                        return std::min<std::size_t>(n - 1, static_cast<std::size_t>((x - std::floor(x)) * n));
                    };
                    const Texture& texture = mesh.texture;
                    const glm::dvec3 texel(linear_colour(
                        texture.texels[at(uv.y, texture.height) * texture.width + at(uv.x, texture.width)]));
                    const double shown = 0.2126 * rgb.r * texel.r + 0.7152 * rgb.g * texel.g + 0.0722 * rgb.b * texel.b;
                    EXPECT_LE(rings.luminance[largest].lo, shown + 1e-6) << which;
                    EXPECT_GE(rings.luminance[largest].hi, shown - 1e-6) << which;
                    ++looked;
                }
            }
        }
        for (NodeId node = 1; node < tree.interior_count(); ++node) {
            const NodeId parent = support::sound(tree).parents()[node];
            EXPECT_LE(rings.texture_deviation[node], rings.texture_deviation[parent]);
            EXPECT_LE(rings.texture[parent].lo, rings.texture[node].lo);
            EXPECT_GE(rings.texture[parent].hi, rings.texture[node].hi);
            EXPECT_LE(rings.vertices[parent].lo, rings.vertices[node].lo);
            EXPECT_GE(rings.vertices[parent].hi, rings.vertices[node].hi);
            EXPECT_LE(rings.luminance[parent].lo, rings.luminance[node].lo);
            EXPECT_GE(rings.luminance[parent].hi, rings.luminance[node].hi);
        }
    }
    EXPECT_GT(looked, 10000);
}

// Two points of triangles around a node that show the same place of the texture, in the mesh and after all below it has
// folded.
TEST(TexturedRings, MoveByNoMoreThanTheirDeviation) {
    const VertexTree flat = built(textures::textured_grid(24, textures::noise(32, 32, 1)));
    const CutRings of_flat = *bound_cut_rings(flat);
    const float size = flat.support_spheres()[0].radius;
    for (NodeId node = 0; node < flat.interior_count(); ++node)
        EXPECT_LE(of_flat.texture_deviation[node], 1e-5f * size);

    // Without seams: wedges and nodes have the same numbers.
    const VertexTree sphere = built(textures::textured_sphere(4, textures::noise(32, 32, 1)));
    const CutRings of_sphere = *bound_cut_rings(sphere);
    int smaller = 0, looked = 0;
    for (NodeId node = 0; node < sphere.interior_count(); ++node) {
        EXPECT_LE(of_sphere.texture_deviation[node], 2 * of_sphere.radius[node]);
        if (sphere.support_spheres()[node].radius > 0.2f) continue;
        smaller += of_sphere.texture_deviation[node] < 0.5f * sphere.support_spheres()[node].radius;
        ++looked;
        // The proxy's place in the texture, on the mesh's triangles around.
        const glm::dvec2 uv(sphere.uvs()[node]);
        const glm::dvec3 proxy(sphere.positions()[node]);
        for (Index t = 0; t < sphere.triangle_count(); ++t) {
            const Triangle& corners = support::sound(sphere).triangles()[t];
            const bool is_around = std::any_of(corners.begin(), corners.end(), [&](Index leaf) {
                return support::sound(sphere).first_leaf()[node] <= leaf &&
                       leaf < support::sound(sphere).leaf_end()[node];
            });
            if (!is_around) continue;
            const auto u = [&](int k) {
                return glm::dvec2(sphere.uvs()[sphere.wedge_of_leaf(corners[static_cast<std::size_t>(k)])]);
            };
            const auto p = [&](int k) {
                return glm::dvec3(sphere.positions()[sphere.wedge_of_leaf(corners[static_cast<std::size_t>(k)])]);
            };
            const glm::dvec2 e = u(1) - u(0), f = u(2) - u(0), to = uv - u(0);
            const double area = e.x * f.y - e.y * f.x;
            if (std::abs(area) < 1e-12) continue;
            const double b = (to.x * f.y - to.y * f.x) / area, c = (e.x * to.y - e.y * to.x) / area;
            if (b < 0 || c < 0 || b + c > 1) continue;
            const glm::dvec3 before = p(0) + b * (p(1) - p(0)) + c * (p(2) - p(0));
            EXPECT_LE(glm::length(before - proxy), static_cast<double>(of_sphere.texture_deviation[node]) * (1 + 1e-6))
                << node;
        }
    }
    EXPECT_GT(smaller, looked / 4);
}

} // namespace textured_rings_test
} // namespace unseen::perception
