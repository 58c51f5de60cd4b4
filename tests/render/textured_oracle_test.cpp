// What the fold tests call invisible on textured models, under the oracle's eyes.

#include <unseen/perception/criterion.h>
#include <unseen/perception/display.h>
#include <unseen/perception/internal/cut_rings.h>
#include <unseen/perception/judge.h>
#include <unseen/render/context.h>
#include <unseen/render/renderer.h>

#include "built.h"
#include "oracle.h"
#include "shapes.h"
#include "textures.h"

namespace unseen::textured_oracle_test {

using support::built;
using vdtree::Cut;
using vdtree::Mesh;
using vdtree::Texture;
using vdtree::VertexTree;
using vdtree::View;

constexpr int window_px = 256;

// A smooth hill of brightness, as of photographs.
Texture hills() {
    Texture texture{128, 128, {}, {}, {}};
    for (int y = 0; y < 128; ++y)
        for (int x = 0; x < 128; ++x) {
            const double waves = std::sin(2 * 3.14159265 * x / 128) * std::sin(2 * 3.14159265 * y / 128);
            const auto code = static_cast<std::uint8_t>(140 + 50 * waves);
            texture.texels.push_back(
                {code, static_cast<std::uint8_t>(code / 2), static_cast<std::uint8_t>(255 - code), 255});
        }
    return texture;
}

// A plane that the texture lies on evenly, and a plane where it is squeezed towards one side.
Mesh squeezed(Mesh mesh) {
    for (glm::vec2& uv : mesh.uvs) uv.x = uv.x * uv.x;
    return mesh;
}

struct Case {
    const char* name;
    Mesh (*make)();
    bool prelit = true;
};
const Case cases[] = {
    {"checkerboard_on_a_sphere",
     [] { return textures::textured_sphere(4, textures::checkerboard(128, 128, 16, 40, 220), 0.9); }},
    {"noise_on_a_sphere", [] { return textures::textured_sphere(5, textures::noise(256, 256, 3, 100, 150)); }},
    {"hills_on_a_bumpy_sphere", [] { return textures::with_uvs(shapes::bumpy_sphere(5, 0.01), hills()); }},
    {"checkerboard_on_a_plane",
     [] { return textures::textured_grid(40, textures::checkerboard(128, 128, 16, 40, 220)); }},
    {"noise_squeezed_on_a_plane",
     [] { return squeezed(textures::textured_grid(40, textures::noise(128, 128, 5, 90, 160))); }},
    {"lit_checkerboard_on_a_sphere",
     [] { return textures::textured_sphere(5, textures::checkerboard(128, 128, 16, 40, 220), 0.9); }, false},
    {"lit_hills_on_a_bumpy_sphere", [] { return textures::with_uvs(shapes::bumpy_sphere(5, 0.01), hills()); }, false},
    {"seams", [] { return textures::with_seams(textures::textured_sphere(4, hills())); }},
};

class TexturedOracle : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Meshes, TexturedOracle, testing::ValuesIn(cases),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_P(TexturedOracle, SeesNothingOfWhatTheSafeTestFolds) {
    const VertexTree tree = built(GetParam().make(), {.prelit = GetParam().prelit});
    const perception::CutRings rings = *perception::bound_cut_rings(tree);
    auto context = render::Context::headless();
    if (!context) GTEST_SKIP() << context.error().message;
    auto renderer = require(render::Renderer::create(*context, tree));
    for (const oracle::Look& look : oracle::looks_at(tree, {.window_px = window_px, .to_the_front = 1.2})) {
        Cut whole(tree);
        whole.unfold_all();
        const perception::Image before = oracle::draw(*renderer, whole, look.view);
        for (const bool is_safe : {false, true}) {
            const auto criterion =
                require(is_safe ? perception::luebke_hallen_safe_distances(tree, rings, look.view, look.options)
                                : perception::luebke_hallen_distances(tree, look.view, look.options));
            EXPECT_TRUE(criterion->is_monotone());
            Cut cut(tree);
            const bool is_closed = tree.closedness() == vdtree::Closedness::closed_outward;
            ASSERT_TRUE(cut.follow(*criterion, perception::viewpoint_of(tree, look.view, look.options),
                                   {.cull_back_faces = is_closed}));
            const perception::Image after = oracle::draw(*renderer, cut, look.view);
            for (const perception::CsfModel model : oracle::judges) {
                const perception::Judgement judged = oracle::judge(before, after, look, model);
                EXPECT_EQ(judged.visible_pixels, 0u)
                    << "from " << oracle::words(look) << (is_safe ? ", safe, " : ", ") << cut.triangle_count() << " of "
                    << tree.triangle_count() << " triangles, largest V " << judged.max_ratio;
            }
        }
    }
}

// What lies evenly on a plane slides nowhere, however rich in contrast it is; squeezed, it does.
TEST(TextureDeviation, LetsEvenTexturesOnPlanesFold) {
    const Texture texture = textures::checkerboard(128, 128, 8, 20, 240);
    const auto inner_triangles = [](const Mesh& mesh) {
        const VertexTree tree = built(mesh);
        const perception::CutRings rings = *perception::bound_cut_rings(tree);
        const perception::Display display;
        View view;
        view.width = view.height = window_px;
        view.fov_y_degrees = perception::physical_field(display, window_px).value();
        const vdtree::Sphere sphere = tree.bounding_sphere();
        view = vdtree::frame_sphere(tree.origin() + glm::dvec3(sphere.centre), sphere.radius, {0, 0, 1}, 0.9, view);
        perception::FoldTestOptions options;
        options.display = display;
        const auto criterion = require(perception::luebke_hallen_safe_distances(tree, rings, view, options));
        Cut cut(tree);
        EXPECT_TRUE(cut.follow(*criterion, perception::viewpoint_of(tree, view, options)));
        return cut.triangle_count();
    };
    const auto all = textures::textured_grid(40, texture).triangles.size();
    EXPECT_LT(inner_triangles(textures::textured_grid(40, texture)), all / 2); // the open border is an outline
    EXPECT_GT(inner_triangles(squeezed(textures::textured_grid(40, texture))), all * 3 / 4);
}

} // namespace unseen::textured_oracle_test
