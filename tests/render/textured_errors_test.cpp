// The test by errors on textured models, under the oracle's eyes: nothing is seen, and about as much folds as without
// the texture.

#include <unseen/perception/criterion.h>
#include <unseen/perception/fold_measurement.h>
#include <unseen/perception/internal/lit_folds.h>
#include <unseen/perception/judge.h>
#include <unseen/render/context.h>
#include <unseen/render/renderer.h>

#include "measured.h"
#include "oracle.h"
#include "shapes.h"
#include "textures.h"

namespace unseen::textured_errors_test {

using vdtree::Cut;
using vdtree::Mesh;
using vdtree::Texture;
using vdtree::VertexTree;

constexpr int window_px = 256;

Texture stripes(std::uint32_t width, std::uint32_t stripe, std::uint8_t dark, std::uint8_t bright) {
    Texture texture{width, 4, {}, {}, {}};
    for (std::uint32_t y = 0; y < 4; ++y)
        for (std::uint32_t x = 0; x < width; ++x) {
            const std::uint8_t code = x / stripe % 2 ? bright : dark;
            texture.texels.push_back({code, code, code, 255});
        }
    return texture;
}

// Dark, with few bright texels: contrasts are over a mean far below the middle of the range.
Texture stars() {
    Texture texture = textures::checkerboard(128, 128, 128, 12, 12);
    for (std::size_t i = 37; i < texture.texels.size(); i += 211) texture.texels[i] = {255, 255, 255, 255};
    return texture;
}

// A smooth hill of brightness, as of photographs.
Texture hills() {
    Texture texture{128, 128, {}, {}, {}};
    for (int y = 0; y < 128; ++y)
        for (int x = 0; x < 128; ++x) {
            const double waves = std::sin(2 * std::numbers::pi * x / 128) * std::sin(2 * std::numbers::pi * y / 128);
            const auto code = static_cast<std::uint8_t>(140 + 50 * waves);
            texture.texels.push_back({code, code, code, 255});
        }
    return texture;
}

// Each of six sides has an island of its own in the texture, with a margin around it.
Mesh with_islands(const Mesh& mesh, const Texture& texture) {
    Mesh out;
    out.texture = texture;
    for (const vdtree::Triangle& t : mesh.triangles) {
        const glm::dvec3 &a = mesh.positions[t[0]], &b = mesh.positions[t[1]], &c = mesh.positions[t[2]];
        const glm::dvec3 n = glm::abs(glm::cross(b - a, c - a)), middle = a + b + c;
        const int axis = n.x >= n.y && n.x >= n.z ? 0 : n.y >= n.z ? 1 : 2;
        const int island = 2 * axis + (middle[axis] > 0);
        vdtree::Triangle own;
        for (std::size_t k = 0; k < 3; ++k) {
            const glm::dvec3 p = mesh.positions[t[k]];
            const glm::dvec2 flat(p[(axis + 1) % 3], p[(axis + 2) % 3]);
            const glm::dvec2 uv =
                (glm::dvec2(island % 3, island / 3) + 0.5 + 0.35 * flat) / glm::dvec2(3, 2); // 0.15 of margin
            own[k] = static_cast<vdtree::Index>(out.positions.size());
            out.positions.push_back(p), out.uvs.push_back(glm::vec2(uv));
        }
        out.triangles.push_back(own);
    }
    // Vertices that are alike become one.
    std::vector<vdtree::Index> order(out.positions.size()), to(out.positions.size());
    for (vdtree::Index i = 0; i < order.size(); ++i) order[i] = i;
    const auto key = [&](vdtree::Index i) {
        const glm::dvec3& p = out.positions[i];
        return std::tuple(p.x, p.y, p.z, out.uvs[i].x, out.uvs[i].y);
    };
    std::sort(order.begin(), order.end(), [&](auto a, auto b) { return key(a) < key(b); });
    Mesh welded;
    welded.texture = texture;
    for (std::size_t i = 0; i < order.size(); ++i) {
        if (i == 0 || key(order[i]) != key(order[i - 1])) {
            welded.positions.push_back(out.positions[order[i]]);
            welded.uvs.push_back(out.uvs[order[i]]);
        }
        to[order[i]] = static_cast<vdtree::Index>(welded.positions.size() - 1);
    }
    for (vdtree::Triangle t : out.triangles) {
        for (vdtree::Index& v : t) v = to[v];
        welded.triangles.push_back(t);
    }
    return welded;
}

struct Case {
    const char* name;
    Mesh (*make)();
    double most_kept; // of the triangles, in the mean over the views
    bool prelit = true;
    bool is_lit_too = false;
    double most_kept_lit = 1;
};
const Case cases[] = {
    {"checkerboard_on_a_sphere",
     [] { return textures::textured_sphere(5, textures::checkerboard(128, 128, 16, 0, 255), 0.9); }, 0.37, true, true,
     0.46},
    {"many_repeats_on_a_sphere",
     [] { return textures::textured_sphere(5, textures::checkerboard(32, 32, 8, 20, 240), 9.3); }, 0.46},
    {"stripes_on_a_bumpy_sphere",
     [] { return textures::with_uvs(shapes::bumpy_sphere(5, 0.01), stripes(256, 8, 0, 255), 2.5); }, 0.67},
    {"noise_on_a_sphere", [] { return textures::textured_sphere(5, textures::noise(256, 256, 3)); }, 0.41, true, true,
     0.44},
    {"hills_on_a_bumpy_sphere", [] { return textures::with_uvs(shapes::bumpy_sphere(5, 0.01), hills()); }, 0.36, true,
     true, 0.65},
    {"stars_on_a_sphere", [] { return textures::textured_sphere(5, stars()); }, 0.25},
    {"checkerboard_on_a_plane",
     [] { return textures::textured_grid(40, textures::checkerboard(128, 128, 16, 0, 255)); }, 0.12, true, true, 0.36},
    {"seams", [] { return textures::with_seams(textures::textured_sphere(5, hills())); }, 0.23, true, true, 0.37},
    {"islands", [] { return with_islands(shapes::icosphere(5), textures::checkerboard(192, 128, 8, 30, 230)); }, 0.39},
    {"lit_checkerboard_on_a_sphere",
     [] { return textures::textured_sphere(5, textures::checkerboard(128, 128, 16, 40, 220), 0.9); }, 0.37, false},
    {"lit_hills_on_a_bumpy_sphere", [] { return textures::with_uvs(shapes::bumpy_sphere(5, 0.01), hills()); }, 0.49,
     false},
};

class TexturedErrors : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Meshes, TexturedErrors, testing::ValuesIn(cases),
                         [](const auto& test) { return std::string(test.param.name); });

Cut cut_of(const VertexTree& tree, const vdtree::DistanceCriterion& criterion, const oracle::Look& look) {
    Cut cut(tree);
    const bool is_closed = tree.closedness() == vdtree::Closedness::closed_outward;
    EXPECT_TRUE(
        cut.follow(criterion, perception::viewpoint_of(tree, look.view, look.options), {.cull_back_faces = is_closed}));
    return cut;
}

// What is seen of a cut by each judge; nothing must be.
void expect_unseen(const perception::Image& before, const perception::Image& after, const oracle::Look& look,
                   const Cut& cut) {
    for (const perception::CsfModel model : oracle::judges) {
        const perception::Judgement judged = oracle::judge(before, after, look, model);
        EXPECT_EQ(judged.visible_pixels, 0u)
            << "from " << oracle::words(look) << ", " << cut.triangle_count() << " of " << cut.tree().triangle_count()
            << " triangles, largest V " << judged.max_ratio;
    }
}

TEST_P(TexturedErrors, AreSeenByNobody) {
    const VertexTree tree = support::measured(support::built(GetParam().make(), {.prelit = GetParam().prelit}));
    auto context = render::Context::headless();
    if (!context) GTEST_SKIP() << context.error().message;
    auto renderer = require(render::Renderer::create(*context, tree));
    double kept = 0, views = 0;
    for (const oracle::Look& look : oracle::looks_at(tree, {.window_px = window_px, .to_the_front = 1.2})) {
        Cut whole(tree);
        whole.unfold_all();
        const auto criterion = require(perception::error_distances(tree, look.view, look.options));
        EXPECT_TRUE(criterion->is_monotone());
        const Cut cut = cut_of(tree, *criterion, look);
        expect_unseen(oracle::draw(*renderer, whole, look.view), oracle::draw(*renderer, cut, look.view), look, cut);
        kept += static_cast<double>(cut.triangle_count()) / tree.triangle_count(), views += 1;
    }
    RecordProperty("kept", std::to_string(kept / views));
    EXPECT_LT(kept / views, GetParam().most_kept);
}

// Under two lights that are none of the tree's own.
TEST_P(TexturedErrors, AreSeenByNobodyUnderLights) {
    if (!GetParam().is_lit_too) GTEST_SKIP() << "others are lit";
    const VertexTree tree = support::built(GetParam().make(), {.prelit = GetParam().prelit});
    const auto folds = require(perception::LitFolds::measure(tree));
    vdtree::Lighting lighting;
    lighting.ambient = 0.15;
    lighting.lights.push_back({.intensity = 0.6, .direction = glm::normalize(glm::dvec3(-0.5, 0.3, 0.8))});
    lighting.lights.push_back({.intensity = 0.2, .direction = glm::normalize(glm::dvec3(1, 0.2, -0.1))});
    const auto lit = require(folds->under(tree, lighting));
    auto context = render::Context::headless();
    if (!context) GTEST_SKIP() << context.error().message;
    auto renderer = require(render::Renderer::create(*context, tree));
    double kept = 0, views = 0;
    for (const oracle::Look& look : oracle::looks_at(*lit, {.window_px = window_px, .to_the_front = 1.2})) {
        const auto criterion = require(perception::error_distances(*lit, look.view, look.options));
        Cut whole(tree);
        whole.unfold_all();
        const Cut cut = cut_of(tree, *criterion, look);
        expect_unseen(oracle::draw(*renderer, whole, look.view, 64, lighting),
                      oracle::draw(*renderer, cut, look.view, 64, lighting), look, cut);
        kept += static_cast<double>(cut.triangle_count()) / tree.triangle_count(), views += 1;
    }
    RecordProperty("kept", std::to_string(kept / views));
    EXPECT_LT(kept / views, GetParam().most_kept_lit);
}

} // namespace unseen::textured_errors_test
