// The oracle of the fold tests on textured models: drawn whole and simplified with many samples, and judged under one model of contrast
// sensitivity and another.
#include <algorithm>
#include <cmath>
#include <string>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <perception/criterion.h>
#include <perception/display.h>
#include <perception/judge.h>
#include <render/context.h>
#include <render/renderer.h>
#include <vdtree/builder.h>

#include "shapes.h"
#include "textures.h"

namespace unseen {
namespace {

using vdtree::Cut;
using vdtree::Mesh;
using vdtree::Texture;
using vdtree::VertexTree;
using vdtree::View;

constexpr int window_px = 256;
constexpr int samples = 64;
constexpr float background = 0.2f; // relative luminance

VertexTree built(const Mesh& mesh) {
    Result<VertexTree> tree = vdtree::build_tree(mesh.view());
    if (!tree) throw std::runtime_error(tree.error().message);
    return std::move(*tree);
}

// A smooth hill of brightness, as of photographs.
Texture hills() {
    Texture texture{128, 128, {}, {}, {}};
    for (int y = 0; y < 128; ++y)
        for (int x = 0; x < 128; ++x) {
            const double waves = std::sin(2 * 3.14159265 * x / 128) * std::sin(2 * 3.14159265 * y / 128);
            const auto code = static_cast<std::uint8_t>(140 + 50 * waves);
            texture.texels.push_back({code, static_cast<std::uint8_t>(code / 2), static_cast<std::uint8_t>(255 - code), 255});
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
};
const Case cases[] = {
    {"checkerboard_on_a_sphere", [] { return textures::textured_sphere(5, textures::checkerboard(128, 128, 16, 40, 220), 0.9); }},
    {"noise_on_a_sphere", [] { return textures::textured_sphere(5, textures::noise(256, 256, 3, 100, 150)); }},
    {"hills_on_a_bumpy_sphere", [] { return textures::with_uvs(shapes::bumpy_sphere(5, 0.01), hills()); }},
    {"checkerboard_on_a_plane", [] { return textures::textured_grid(40, textures::checkerboard(128, 128, 16, 40, 220)); }},
    {"noise_squeezed_on_a_plane", [] { return squeezed(textures::textured_grid(40, textures::noise(128, 128, 5, 90, 160))); }},
    {"seams", [] { return textures::with_seams(textures::textured_sphere(4, hills())); }},
};

class TexturedOracle : public testing::TestWithParam<Case> {
protected:
    perception::Image draw(render::Renderer& renderer, const Cut& cut, const View& view) const {
        render::DrawOptions options;
        options.samples = samples;
        options.background = background;
        const auto frame = renderer.draw(cut, view, options);
        if (!frame) throw std::runtime_error(frame.error().message);
        perception::Image image{frame->width, frame->height, 1, frame->luminance};
        for (float& value : image.values) value = static_cast<float>(perception::to_luminance(display_, static_cast<double>(value)).value());
        return image;
    }
    perception::Display display_;
};
INSTANTIATE_TEST_SUITE_P(Meshes, TexturedOracle, testing::ValuesIn(cases), [](const auto& test) { return std::string(test.param.name); });

TEST_P(TexturedOracle, SeesNothingOfWhatTheSafeTestFolds) {
    const VertexTree tree = built(GetParam().make());
    const vdtree::CutRings rings = vdtree::bound_cut_rings(tree);
    auto context = render::Context::headless();
    if (!context) GTEST_SKIP() << context.error().message;
    auto renderer = render::Renderer::create(*context, tree);
    ASSERT_TRUE(renderer) << renderer.error().message;
    const vdtree::Sphere sphere = tree.bounding_sphere();
    const vdtree::LuminanceRange range = tree.luminance_range();
    for (int trial = 0; trial < 6; ++trial) {
        View view;
        view.width = view.height = window_px;
        view.fov_y_degrees = perception::physical_field(display_, window_px).value();
        const glm::dvec3 direction(std::sin(1.7 * trial), std::cos(2.9 * trial), 1.2 + std::cos(1.1 * trial));
        view = vdtree::frame_sphere(tree.origin() + glm::dvec3(sphere.centre), sphere.radius, direction, trial % 3 == 2 ? 0.15 : 0.85, view);
        perception::FoldTestOptions options;
        options.display = display_;
        options.scene = {std::min(range.lo, background), std::max(range.hi, background)};
        if (trial % 2) options.gaze_px = glm::dvec2(window_px * 0.5 + 1100, window_px * 0.5);
        Cut whole(tree);
        whole.unfold_all();
        const perception::Image before = draw(*renderer, whole, view);
        for (const bool is_safe : {false, true}) {
            const auto criterion = is_safe ? perception::luebke_hallen_safe_distances(tree, rings, view, options)
                                           : perception::luebke_hallen_distances(tree, view, options);
            ASSERT_TRUE(criterion) << criterion.error().message;
            EXPECT_TRUE(criterion->is_monotone());
            Cut cut(tree);
            const bool is_closed = tree.closedness() == vdtree::Closedness::closed_outward;
            ASSERT_TRUE(cut.follow(*criterion, perception::viewpoint_of(tree, view, options), {.cull_back_faces = is_closed}));
            const perception::Image after = draw(*renderer, cut, view);
            for (const perception::CsfModel model : {perception::CsfModel::castle, perception::CsfModel::stela}) {
                const auto judged = perception::judge_modern(before, after, {.display = display_, .gaze_px = options.gaze_px, .csf = model});
                ASSERT_TRUE(judged) << judged.error().message;
                EXPECT_EQ(judged->visible_pixels, 0u) << "view " << trial << (is_safe ? ", safe, " : ", ") << cut.triangle_count() << " of " << tree.triangle_count()
                                                      << " triangles, largest V " << judged->max_ratio;
                if (model == perception::CsfModel::castle)
                    RecordProperty("view_" + std::to_string(trial) + (is_safe ? "_safe" : ""),
                                   std::to_string(cut.triangle_count()) + " of " + std::to_string(tree.triangle_count()) + ", V " + std::to_string(judged->max_ratio));
            }
        }
    }
}

// What lies evenly on a plane slides nowhere, however rich in contrast it is; squeezed, it does.
TEST(TextureDeviation, LetsEvenTexturesOnPlanesFold) {
    const Texture texture = textures::checkerboard(128, 128, 8, 20, 240);
    const auto inner_triangles = [](const Mesh& mesh) {
        const VertexTree tree = built(mesh);
        const vdtree::CutRings rings = vdtree::bound_cut_rings(tree);
        const perception::Display display;
        View view;
        view.width = view.height = window_px;
        view.fov_y_degrees = perception::physical_field(display, window_px).value();
        const vdtree::Sphere sphere = tree.bounding_sphere();
        view = vdtree::frame_sphere(tree.origin() + glm::dvec3(sphere.centre), sphere.radius, {0, 0, 1}, 0.9, view);
        perception::FoldTestOptions options;
        options.display = display;
        const auto criterion = perception::luebke_hallen_safe_distances(tree, rings, view, options);
        if (!criterion) throw std::runtime_error(criterion.error().message);
        Cut cut(tree);
        EXPECT_TRUE(cut.follow(*criterion, perception::viewpoint_of(tree, view, options)));
        return cut.triangle_count();
    };
    const auto all = textures::textured_grid(40, texture).triangles.size();
    EXPECT_LT(inner_triangles(textures::textured_grid(40, texture)), all / 2); // the open border is an outline
    EXPECT_GT(inner_triangles(squeezed(textures::textured_grid(40, texture))), all * 3 / 4);
}

} // namespace
} // namespace unseen
